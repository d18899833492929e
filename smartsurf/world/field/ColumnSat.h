// The directions that tell how far a convex piece and the upright columns of a field are apart.
//
// Two bodies with flat faces are as far apart as the best of these says: the normals of the faces of either,
// and those of the planes along an edge of each. Of the piece's edges only those count whose two faces look
// to both sides of the column's edge, a few of a hull. How far the piece reaches down each direction is
// worked out once, for all columns.
#pragma once

#include <vector>

#include "smartsurf/world/field/Columns.h"
#include "smartsurf/world/narrowphase/Gjk.h"

namespace smartsurf::world {

class ColumnSat {
 public:
  // Of a piece between the corners `low` and `high` of its bounds.
  void set(const ConvexProxy&, const Vec3& low, const Vec3& high);

  struct BestAxis {
    Vec3 normal{0, 0, 1};     // from the column to the piece
    float separation = 0.0F;  // the piece and the column are at least that far apart
  };
  // The direction of the widest gap, or of the least overlap, that does not lean out over a bridge. False
  // when some gap exceeds the margin. Of a piece that is round the gap may be wider than told.
  bool find_best_axis(const Column&, float margin, BestAxis& out);

 private:
  // One entry a direction.
  struct AxisList {
    std::vector<float> x, y, z;         // the normal
    std::vector<float> min_projection;  // of normal · p over the points p of the piece
    std::vector<float> bias;  // crossing edges must win clearly, or the choice would change from step to step
    void clear();
    void add(const Vec3& normal, float projection, float axis_bias);
    std::size_t size() const { return x.size(); }
    float separation(std::size_t i, const Column&) const;
  };
  void add(const Vec3& normal, float min_projection, float bias);
  void add_box(const ConvexProxy&);
  void add_hull(const ConvexProxy&);
  void add_axisymmetric(const ConvexProxy&);

  AxisList axes_;
  std::vector<float> separation_;       // along each
  std::vector<float> face_normals_[2];  // of the normals of a hull's faces: their parts along x and y
  std::size_t separating_axis_ = 0;     // the axis that told the last two apart
};

}  // namespace smartsurf::world
