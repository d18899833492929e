// Visits the cells of one model that an object covers.
#pragma once

#include "smartsurf/surface/actuators/CellFinder.h"
#include "smartsurf/surface/actuators/VerticalIntersection.h"

namespace smartsurf::surface {

// Calls visit(cell, point, gap) for every cell whose centre is covered by the body and whose top is at most
// `reach` below the body's underside. point: on the underside above the cell's centre, relative to the body's
// origin, u; gap: distance from the cell's top up to that point, u, ≥ 0.
template <class Visit>
void for_each_covered_cell(const CellFinder& cells, const Field& field, const BodyView& bodies,
                           std::size_t body, const scene::ObjectSpec& object, float reach, Visit visit) {
  const Eigen::Vector3f& centre = bodies.position[body];
  const VerticalIntersector intersector(object, bodies.orientation[body]);
  if (!centre.allFinite() || centre.z() - object.half_extents().norm() > field.max_height + reach) return;
  cells.for_each_near(centre.x(), centre.y(), intersector.horizontal_reach(),
                      [&](int cell, float x, float y) {
                        const Eigen::Vector2f offset(x - centre.x(), y - centre.y());
                        const VerticalIntersection interval = intersector.intersect(offset.x(), offset.y());
                        const float top = field.height[cell] - centre.z();
                        if (interval.low > interval.high || interval.high < top || interval.low - top > reach)
                          return;
                        visit(cell, Eigen::Vector3f(offset.x(), offset.y(), interval.low),
                              std::max(0.0F, interval.low - top));
                      });
}

}  // namespace smartsurf::surface
