// What the last look at a body on the field told, and for how long it holds: as long as neither the body nor
// any cell under it has moved much against the others.
#pragma once

#include <vector>

#include "smartsurf/surface/Field.h"
#include "smartsurf/world/BodyStore.h"
#include "smartsurf/world/Contact.h"
#include "smartsurf/world/field/Columns.h"

namespace smartsurf::world {

class FieldManifoldCache {
 public:
  // All that may bear the body are kept: which of them do is chosen anew in every step.
  struct CachedPoint {
    Vec3 on_body;          // in the body's axes
    Vec3 on_cell, normal;  // world frame; the normal from the cell to the body
    float top;             // of the cell, when it was looked at
    std::int32_t cell;
    std::int32_t part_index;
  };
  struct CachedManifold {
    std::int32_t body;
    Mat3 axes;
    Vec3 centre;
    Vec3 near_centre,
        near_half_extents;  // of a box about all of the body that may soon meet the cells, world axes
    float clearance;        // nothing but the points was nearer, u
    CellRange cells;        // the cells that were looked at
    std::int32_t first_point, point_count;  // in points
    std::int32_t first_height;              // in heights: of those cells, row by row
    // ---- of the last step's
    const CachedPoint* points = nullptr;
    const float* heights = nullptr;
  };
  // Of one chunk of bodies.
  struct ChunkCache {
    std::vector<CachedManifold> manifolds;
    std::vector<CachedPoint> points;
    std::vector<float> heights;
  };

  // The field must be rectangular and none of its cells give way.
  explicit FieldManifoldCache(const surface::Field& field) : field_(field) {}

  // Takes over what the last step noted in a chunk's list and leaves the list empty. Then index.
  void swap_in(int chunk, ChunkCache&);
  void build_index(int bodies);

  // Appends the contacts of a body that is no sphere with gaps up to `margin`, and notes them for the next
  // step.
  void collide(const BodyStore&, std::size_t body, float margin, ChunkCache& chunk_cache,
               std::vector<Contact>& out) const;

 private:
  struct HeightChange {
    float low, high;
  };

  bool is_valid(const BodyStore&, std::size_t body, float margin, const CachedManifold&) const;
  HeightChange height_change_since(const CachedManifold&) const;
  bool level_cells_separated(const CachedManifold&) const;
  void rebuild(const BodyStore&, std::size_t body, float margin, const CellRange& cells, float max_height,
               ChunkCache& chunk_cache) const;
  void reuse(const CachedManifold&, ChunkCache& chunk_cache) const;
  bool reduce(const BodyStore&, std::size_t body, float margin, float slip_limit,
              const ChunkCache& chunk_cache, std::vector<Contact>& out) const;

  const surface::Field& field_;
  std::vector<ChunkCache> previous_;                     // one a chunk
  std::vector<const CachedManifold*> manifold_of_body_;  // of each body
};

}  // namespace smartsurf::world
