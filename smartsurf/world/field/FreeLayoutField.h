// Contacts with a field whose cells have arbitrary positions and rotations about the vertical; slower than a
// rectangular layout.
//
// Each cell near a body is tested in its own frame, as the centre of a 3×3 rectangular field. Level
// neighbours across a side bridge the gap, as in a rectangular layout.
#pragma once

#include <vector>

#include "smartsurf/surface/Field.h"
#include "smartsurf/world/body/Shape.h"
#include "smartsurf/world/contact/Contact.h"
#include "smartsurf/world/field/SphereOnField.h"

namespace smartsurf::world {

class FreeLayoutField {
 public:
  // `field` must outlive the object, and its layout must not change.
  explicit FreeLayoutField(const surface::Field&);

  // Append the contacts of a sphere, or of another shape, reduced as in a rectangular layout, with
  // separations up to `margin`.
  void collide_sphere(const Vec3& centre, float radius, float margin, const SphereMotion&,
                      std::vector<Contact>& out) const;
  void collide(const Shape&, const Vec3& centre, const Mat3& axes, float margin,
               std::vector<Contact>& out) const;
  // The cells near a box, ascending.
  void find_cells(const Vec3& low, const Vec3& high, std::vector<std::int32_t>& out) const;

 private:
  // Cells across the west, east, north and south side, sampled at two points of each; −1 if there is none.
  struct Neighbours {
    std::int32_t cell[4][2];
  };
  struct CellFrame;
  template <class Each>
  void for_each_cell(const Vec3& low, const Vec3& high, Each each) const;
  // Calls each(cell, local grid, frame) for the cells near a box that reach up to it.
  template <class Each>
  void for_each_local_grid(const Vec3& low, const Vec3& high, Each each) const;
  int bucket(float u, int axis) const;
  int cell_at(float x, float y, float tolerance) const;
  Neighbours find_neighbours(std::size_t cell) const;
  bool is_bridged(std::size_t cell, int side) const;
  surface::Field make_local_grid() const;
  void load_local_grid(std::size_t cell, surface::Field& local_grid) const;

  const surface::Field& field_;
  float origin_[2], bucket_size_, half_diagonal_;
  int bucket_count_[2];
  std::vector<std::int32_t> bucket_begin_, bucket_cells_;  // cells by bucket
  std::vector<Neighbours> neighbours_;
};

}  // namespace smartsurf::world
