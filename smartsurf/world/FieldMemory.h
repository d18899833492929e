// What the last look at a body on the field told, and for how long it holds: as long as neither the body nor
// any cell under it has moved much against the others.
#pragma once

#include <vector>

#include "smartsurf/surface/Field.h"
#include "smartsurf/world/BodyStore.h"
#include "smartsurf/world/Columns.h"
#include "smartsurf/world/Contact.h"

namespace smartsurf::world {

class FieldMemory {
 public:
  // All that may bear the body are kept: which of them do is chosen anew in every step.
  struct Point {
    Vec3 on_body;          // in the body's axes
    Vec3 on_cell, normal;  // world frame; the normal from the cell to the body
    float top;             // of the cell, when it was looked at
    std::int32_t cell;
    std::int32_t piece;
  };
  struct Known {
    std::int32_t body;
    Mat3 axes;
    Vec3 centre;
    Vec3 middle, half;          // of a box about all of the body that may soon meet the cells, world axes
    float clear;                // nothing but the points was nearer, u
    CellRange under;            // the cells that were looked at
    std::int32_t first, count;  // in points
    std::int32_t first_height;  // in heights: of those cells, row by row
    // ---- of the last step's
    const Point* points = nullptr;
    const float* heights = nullptr;
  };
  // Of one chunk of bodies.
  struct List {
    std::vector<Known> bodies;
    std::vector<Point> points;
    std::vector<float> heights;
  };

  // The field must be rectangular and none of its cells give way.
  explicit FieldMemory(const surface::Field& field) : field_(field) {}

  // Takes over what the last step noted in a chunk's list and leaves the list empty. Then index.
  void take(int chunk, List&);
  void index(int bodies);

  // Appends the contacts of a body that is no sphere with gaps up to `margin`, and notes them for the next
  // step.
  void touch(const BodyStore&, std::size_t body, float margin, List& now, std::vector<Contact>& out) const;

 private:
  struct Rises {
    float low, high;
  };

  bool holds(const BodyStore&, std::size_t body, float margin, const Known&) const;
  Rises rises_since(const Known&) const;
  bool level_cells_moved_apart(const Known&) const;
  void look(const BodyStore&, std::size_t body, float margin, const CellRange& under, float highest,
            List& now) const;
  void repeat(const Known&, List& now) const;
  bool choose(const BodyStore&, std::size_t body, float margin, float most_slip, const List& now,
              std::vector<Contact>& out) const;

  const surface::Field& field_;
  std::vector<List> old_;            // one a chunk
  std::vector<const Known*> first_;  // of each body
};

}  // namespace smartsurf::world
