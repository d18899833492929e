// The bodies that may touch in a step: how far each may reach, those that are fast or large, and their
// neighbours.
#include <algorithm>
#include <cmath>
#include <limits>

#include "smartsurf/world/CollisionPipeline.h"

namespace smartsurf::world {

// Bodies above four times the median radius are large: a few of them must not widen the grid cells for all
// others.
void CollisionPipeline::compute_large_radius(const BodyStore& bodies) {
  std::vector<float> reach;
  for (std::size_t i = 0; i < bodies.bounding_radius.size(); ++i)
    if (!bodies.is_static(i)) reach.push_back(bodies.bounding_radius[i]);
  large_radius_ = 1.0F;
  if (reach.empty()) return;
  const auto middle = reach.begin() + reach.size() / 2;
  std::nth_element(reach.begin(), middle, reach.end());
  large_radius_ = 4.0F * *middle;
}

void CollisionPipeline::measure_bodies(const BodyStore& bodies) {
  thickness_.clear();
  fast_margin_.clear();
  least_thickness_ = std::numeric_limits<float>::infinity();
  any_compound_ = false;
  for (std::size_t i = 0; i < bodies.bounding_radius.size(); ++i) {
    float thickness = bodies.width[i];
    for (const ConvexHullShape& hull : bodies.shape[i]->hulls) thickness = std::min(thickness, hull.width);
    thickness_.push_back(thickness);
    least_thickness_ = std::min(least_thickness_, thickness);
    any_compound_ |= bodies.shape[i]->hulls.size() > 1;
    // Large bodies are tested with their whole margin anyway.
    const bool in_cells = !bodies.is_static(i) && 2.0F * bodies.bounding_radius[i] <= large_radius_;
    fast_margin_.push_back(in_cells ? std::max(kMinSpeculativeMargin, bodies.bounding_radius[i])
                                    : std::numeric_limits<float>::infinity());
  }
}

float CollisionPipeline::travel_of(const BodyStore& bodies, std::size_t i) const {
  if (!bodies.is_active(i)) return 0.0F;
  float speed = bodies.velocity(i).norm();
  if (!bodies.is_sphere[i]) speed += bodies.angular_velocity(i).norm() * bodies.bounding_radius[i];
  return speed * dt_s_;
}

bool CollisionPipeline::has_room(const BodyStore& bodies, std::size_t body, std::int32_t partner,
                                 float reach) const {
  const Vec3& at = bodies.position[body];
  const Vec3 half = Vec3::Constant(bodies.bounding_radius[body] + reach);
  if ((at - half).z() < ground_height_ || collider_.may_overlap(at - half, at + half)) return false;
  bool found = false;
  const auto test = [&](std::int32_t other) {
    if (other == partner || other == static_cast<std::int32_t>(body)) return;
    const float distance = half.x() + bodies.bounding_radius[other] + travel_[other];
    found |= (bodies.position[other] - at).squaredNorm() < distance * distance;
  };
  const auto test_grid = [&](const UniformGrid& grid) {
    if (!found) grid.for_each_in_box(at - half, at + half, test);
    if (!found) std::ranges::for_each(grid.large_bodies(), test);
  };
  test_grid(*grid_), test_grid(sleeper_grid_);
  return !found;
}

float CollisionPipeline::compute_query_radii(const BodyStore& bodies, std::span<const std::int32_t> own) {
  float max_travel = 0.0F;
  for (const std::int32_t i : own) {
    travel_[i] = travel_of(bodies, i);
    speculative_margin_[i] = std::max(kMinSpeculativeMargin, travel_[i]);
    max_travel = std::max(max_travel, travel_[i]);
    if (!bodies.is_sphere[i])
      half_extents_[i] = turned_extents(bodies.axes[i], bodies.shape[i]->half_extents);
    // Static bodies count as large: other bodies query them, and they do not query others.
    query_radius_[i] = bodies.is_static(i) ? 1e30F
                                           : bodies.bounding_radius[i] +
                                                 std::min(speculative_margin_[i], bodies.bounding_radius[i]);
  }
  return max_travel;
}

void CollisionPipeline::find_fast_bodies(const BodyStore& bodies) {
  fast_bodies_.clear();
  max_fast_length_ = 0.0F;
  // Two bodies close by twice the greatest travel at most; a fast body is one that moves by half of its
  // width.
  may_any_pass_ = 4.0F * std::ranges::max(max_travel_) > least_thickness_;
  if (!may_any_pass_) return;
  for (const std::int32_t i : grid_bodies_) {
    if (!is_fast(i) || !bodies.position[i].allFinite()) continue;
    const FastBody& f = fast_bodies_.emplace_back(fast_body(bodies, i));
    max_fast_length_ = std::max(max_fast_length_, f.high.x() - f.low.x());
  }
  std::ranges::stable_sort(fast_bodies_, {}, [](const FastBody& f) { return f.low.x(); });
}

CollisionPipeline::FastBody CollisionPipeline::fast_body(const BodyStore& bodies, std::size_t i) const {
  const Vec3 reach = Vec3::Constant(bodies.bounding_radius[i] + kMinSpeculativeMargin);
  const Vec3 from = bodies.position[i], to = from + dt_s_ * bodies.velocity(i);
  return {static_cast<std::int32_t>(i), from.cwiseMin(to) - reach, from.cwiseMax(to) + reach};
}

// Lists a fast body as a neighbour of all that its path may meet: the grid's search around its start would
// miss them.
void CollisionPipeline::find_fast_neighbours(const BodyStore& bodies) {
  const auto add_large = [&](std::int32_t l) {
    const Vec3 half = turned_extents(bodies.axes[l], bodies.shape[l]->half_extents) +
                      Vec3::Constant(speculative_margin_[l]);
    const Vec3 centre = bodies.origin(l);
    for_each_fast_in_box(centre - half, centre + half, 0, [&](std::int32_t fast) {
      large_neighbours_.push_back({fast, l});
    });
  };
  std::ranges::for_each(grid_->large_bodies(), add_large);
  std::ranges::for_each(sleeper_grid_.large_bodies(), add_large);
  for (std::size_t k = 0; k < fast_bodies_.size(); ++k) {
    const FastBody& f = fast_bodies_[k];
    grid_->for_each_in_box(f.low, f.high, [&](std::int32_t body) {
      if (!is_fast(body)) large_neighbours_.push_back({body, f.body});
    });
    for_each_fast_in_box(f.low, f.high, k + 1, [&](std::int32_t other) {
      large_neighbours_.push_back({other, f.body});
    });
    sleeper_grid_.for_each_in_box(f.low, f.high, [&](std::int32_t sleeper) {
      large_neighbours_.push_back({f.body, sleeper});
    });
  }
}

void CollisionPipeline::find_large_neighbours(const BodyStore& bodies) {
  if (large_neighbours_of_.size() != bodies.id.size())
    large_neighbours_of_.assign(bodies.id.size(), {0, 0});
  else
    for (const LargeNeighbour& n : large_neighbours_) large_neighbours_of_[n.body] = {0, 0};
  large_neighbours_.clear();
  const auto add_large = [&](std::int32_t l) {
    for_each_in_reach_of_large(bodies, *grid_, l, [&](std::int32_t body) {
      if (fast_bodies_.empty() || !is_fast(body)) large_neighbours_.push_back({body, l});
    });
  };
  std::ranges::for_each(grid_->large_bodies(), add_large);
  std::ranges::for_each(sleeper_grid_.large_bodies(), add_large);
  if (!fast_bodies_.empty()) find_fast_neighbours(bodies);
  group_large_neighbours();
}

// A counting sort: the neighbours of a body follow each other, in the order in which they were found.
void CollisionPipeline::group_large_neighbours() {
  found_large_neighbours_.swap(large_neighbours_);
  large_neighbours_.resize(found_large_neighbours_.size());
  constexpr int kUnplaced = -1;
  for (const LargeNeighbour& n : found_large_neighbours_) {
    IndexRange& range = large_neighbours_of_[n.body];
    range = {kUnplaced, range.end + 1};  // until it is placed, `end` counts
  }
  int at = 0;
  for (const LargeNeighbour& n : found_large_neighbours_) {
    IndexRange& range = large_neighbours_of_[n.body];
    if (range.begin == kUnplaced) {
      const int count = range.end;
      range = {at, at};
      at += count;
    }
    large_neighbours_[range.end++] = n;
  }
}

}  // namespace smartsurf::world
