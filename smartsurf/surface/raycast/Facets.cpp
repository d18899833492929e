#include "smartsurf/surface/raycast/Facets.h"

namespace smartsurf::surface {
namespace {

class FacetBuilder {
 public:
  void add(const Eigen::Vector3f& normal, float offset) {
    if (lane_ == 0) facets_.emplace_back();
    FacetBlock& block = facets_.back();
    block.x[lane_] = normal.x();
    block.y[lane_] = normal.y();
    block.z[lane_] = normal.z();
    block.offset[lane_] = offset;
    lane_ = (lane_ + 1) % FacetBlock::kLanes;
  }
  Facets take() { return std::move(facets_); }

 private:
  Facets facets_;
  int lane_ = 0;
};

Facets box_facets(const Eigen::Vector3f& half) {
  FacetBuilder b;
  for (int i = 0; i < 3; ++i)
    for (const float side : {1.0F, -1.0F}) b.add(side * Eigen::Vector3f::Unit(i), half[i]);
  return b.take();
}

Facets hull_facets(const scene::ConvexHull& hull) {
  FacetBuilder b;
  for (const scene::ConvexHull::Face& face : hull.faces) b.add(face.normal, face.offset);
  return b.take();
}

}  // namespace

Polyhedron polyhedron_of(const scene::ObjectSpec& object) {
  Polyhedron all{object.solid.get(), {}};
  if (object.solid)
    for (const scene::ConvexHull& hull : object.solid->hulls) all.hulls.push_back(hull_facets(hull));
  else
    all.hulls.push_back(box_facets(object.half_extents().cast<float>()));
  return all;
}

}  // namespace smartsurf::surface
