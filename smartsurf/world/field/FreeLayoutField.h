// Contacts with a field whose cells have arbitrary positions and rotations about the vertical; slower than a
// rectangular layout.
//
// Each cell near a body is tested in its own frame. Where a body stands over a side, the tops across it and
// the distances to them are those of the layout. Level ones are bridged as in a rectangular layout, but the
// column reaches across the whole gap: halves of a gap between sides at an angle would leave a part of it.
#pragma once

#include <vector>

#include "smartsurf/surface/Field.h"
#include "smartsurf/world/body/Shape.h"
#include "smartsurf/world/contact/Contact.h"
#include "smartsurf/world/field/Columns.h"
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

  // The column of a cell in its own frame, with its half of the gaps that are bridged for a body over the
  // box, which is in that frame too.
  Column column(std::size_t cell, const Vec3& low, const Vec3& high, float gap_entered) const;

 private:
  // An interval of a cell's side, measured from the side's midpoint: it faces one other top or none.
  struct Stretch {
    float begin, end;          // u
    float gap_begin, gap_end;  // distance across at both ends, u
    float open_width;          // without a top across: its length, or infinite at the end of the layout
    std::int32_t cell;         // across, or −1
  };
  struct CellFrame;
  // Calls each(cell) for the cells whose bridged columns may touch the box.
  template <class Each>
  void for_each_cell(const Vec3& low, const Vec3& high, Each each) const;
  // The same for those that reach up to it: each(cell, frame).
  template <class Each>
  void for_each_column(const Vec3& low, const Vec3& high, Each each) const;
  int bucket(float u, int axis) const;
  bool is_free(const Vec3& point) const;
  void add_stretches(std::size_t cell, int side);
  bool is_level(std::size_t cell, const Stretch&) const;
  FreeCell gaps_around(std::size_t cell, const Vec3& low, const Vec3& high) const;

  const surface::Field& field_;
  float origin_[2], bucket_size_, cell_reach_;
  int bucket_count_[2];
  std::vector<std::int32_t> bucket_begin_, bucket_cells_;  // cells by bucket
  std::vector<std::int32_t> stretch_begin_;                // by cell and side
  std::vector<Stretch> stretches_;
};

}  // namespace smartsurf::world
