// Separating-axis test of a convex part against the columns of the field.
//
// The candidate axes are the face normals of both and the cross products of their edges. Of the part's edges
// only those whose faces lie on both sides of the column's edge on the Gauss map count, a few per hull. The
// part's projection on each axis is computed once for all columns.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "smartsurf/world/field/Columns.h"
#include "smartsurf/world/narrowphase/Gjk.h"

namespace smartsurf::world {

class ColumnSat {
 public:
  // Prepares a part whose bounding box is [low, high].
  void set(const ConvexProxy&, const Vec3& low, const Vec3& high);

  struct BestAxis {
    Vec3 normal{0, 0, 1};     // from the column to the part
    float separation = 0.0F;  // lower bound of the separation, u
  };
  // Finds the axis of greatest separation that does not lean over a bridge. For axisymmetric parts the true
  // separation may be greater. Returns false if
  // - some axis separates the two by more than the margin, or
  // - the way out over a bridge is much shorter and the axis found is that of a side which faces away from
  //   the part, or
  // - the way out over a bridge is much shorter and the axis found is no side's, but the part stands `beside`
  //   the column.
  bool find_best_axis(const Column&, float margin, bool beside, BestAxis& out);
  // The edge axis of greatest separation from the last column, if that exceeds the separation along the axis
  // found: the bias against edge axes then decided.
  std::optional<BestAxis> nearer_edge_axis() const;
  // The lower face of a hull that has this outward normal; −1 without one.
  int find_face(const Vec3& normal) const;
  // The greatest separation from the last column along the normals of a hull's lower faces and edges other
  // than the chosen axis, this face and its edges; -infinity without any.
  float separation_of_other_features(int face) const;

 private:
  // One entry per axis, and copies of the first one to fill up the last group of four.
  struct AxisList {
    std::vector<float> x, y, z;         // the normal
    std::vector<float> min_projection;  // least normal · p over the part's points p
    std::vector<float> bias;            // penalty of edge axes; keeps the choice stable from step to step
    std::size_t count = 0;

    void clear() { count = 0; }
    // Call before add() for up to so many axes in all.
    void reserve(std::size_t axes);
    void add(const Vec3& normal, float projection, float axis_bias);
    void pad();  // call after the last add()
    std::size_t size() const { return count; }
    float separation(std::size_t i, const Column&) const;
    // Writes the separations along all axes, and returns the greatest.
    float separations(const Column&, float* out) const;
  };
  void add(const Vec3& normal, float min_projection, float bias);
  void note_feature(std::size_t left, std::size_t right);
  void add_box(const ConvexProxy&);
  void add_hull(const ConvexProxy&);
  void add_axisymmetric(const ConvexProxy&);
  bool find_radial_axis(const Column&, BestAxis& out) const;

  AxisList axes_;
  // The axes of a hull's faces and edges, with the adjacent faces.
  std::size_t first_feature_ = 0;
  std::vector<std::array<std::uint16_t, 2>> faces_of_feature_;
  std::size_t chosen_ = 0;                  // the axis found
  Vec3 centre_{0, 0, 0};                    // of the part
  std::optional<ConvexProxy> round_proxy_;  // of an axisymmetric part
  std::vector<float> separation_;           // along each axis
  std::vector<float> face_normals_[3];      // x, y and z components of a hull's face normals
  std::size_t separating_axis_ = 0;         // the axis that separated the last column
};

}  // namespace smartsurf::world
