#include "smartsurf/world/narrowphase/ManifoldReducer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>
#include <vector>

using namespace smartsurf::world;

namespace {

using Point = Eigen::Vector2d;

// The distance of a point from the nearest side of the convex hull of others, positive inside.
double depth_in_hull(const Point& of, const std::vector<Point>& points) {
  double least = std::numeric_limits<double>::infinity();
  for (const Point& from : points)
    for (const Point& to : points) {
      const Point along = to - from;
      if (along.norm() < 1e-9) continue;
      const Point inward = Point(-along.y(), along.x()).normalized();
      if (std::ranges::all_of(points, [&](const Point& p) { return inward.dot(p - from) > -1e-6; }))
        least = std::min(least, inward.dot(of - from));
    }
  return least;
}

struct Reduced {
  Point load;
  std::vector<Point> candidates, selected;
};

// Points at random in a tilted plane, and a load point well within their hull.
Reduced reduce_random_points(std::mt19937& random, bool knows_load) {
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  const Eigen::Vector3d normal =
      Eigen::Vector3d(0.4 * uniform(random), 0.4 * uniform(random), 1).normalized();
  const Eigen::Vector3d east = normal.unitOrthogonal(), north = normal.cross(east);
  Reduced out;
  ManifoldReducer reducer;
  const auto to_world = [&](const Point& p) { return Vec3((p.x() * east + p.y() * north).cast<float>()); };
  const int count = 5 + static_cast<int>(random() % 8);
  for (int i = 0; i < count; ++i) {
    out.candidates.push_back({3 * uniform(random), 2 * uniform(random)});
    reducer.add({to_world(out.candidates.back()), normal.cast<float>(), 0.0F, i});
  }
  do out.load = {3 * uniform(random), 2 * uniform(random)};
  while (!(depth_in_hull(out.load, out.candidates) > 0.02));
  const auto take = [&](const ManifoldCandidate& c) { out.selected.push_back(out.candidates[c.tag]); };
  if (knows_load)
    reducer.reduce(take, to_world(out.load));
  else
    reducer.reduce(take);
  return out;
}

}  // namespace

TEST(ManifoldReducer, LoadIsAboveTheSelectedPoints) {
  std::mt19937 random(1);
  int more_than_four = 0;
  for (int draw = 0; draw < 2000; ++draw) {
    const Reduced r = reduce_random_points(random, true);
    EXPECT_GT(depth_in_hull(r.load, r.selected), -2e-3) << draw;
    more_than_four += r.selected.size() > 4 ? 1 : 0;
  }
  EXPECT_LT(more_than_four, 1000);  // only where it takes them
}

TEST(ManifoldReducer, SelectsTheWholeHullWhereTheLoadIsUnknown) {
  std::mt19937 random(2);
  for (int draw = 0; draw < 2000; ++draw) {
    const Reduced r = reduce_random_points(random, false);
    if (r.selected.size() == 8) continue;
    for (const Point& p : r.candidates) EXPECT_GT(depth_in_hull(p, r.selected), -0.02 * 7.3) << draw;
  }
}
