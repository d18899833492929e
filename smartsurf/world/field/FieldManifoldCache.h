// Caches the manifolds of bodies on the field, valid while neither the body nor the cells under it have moved
// much relative to each other.
#pragma once

#include <vector>

#include "smartsurf/surface/Field.h"
#include "smartsurf/world/body/BodyMap.h"
#include "smartsurf/world/body/BodyStore.h"
#include "smartsurf/world/contact/Contact.h"
#include "smartsurf/world/field/Columns.h"

namespace smartsurf::world {

class FieldManifoldCache {
 public:
  // All candidate points are stored; their reduction, plane by plane, is repeated in every step.
  struct CachedPoint {
    Vec3 on_body;          // in the body's axes
    Vec3 on_cell, normal;  // world frame; normal from the cell to the body
    float top;             // height of the cell when cached, u
    std::int32_t cell;
    std::int32_t part_index, plane;
    float least_separation;  // nearer, the manifold is computed again
  };
  struct CachedManifold {
    std::int32_t body;
    Mat3 axes;
    Vec3 centre;
    // Box around the part of the body near the cells, world axes.
    Vec3 near_centre, near_half_extents;
    float clearance;                        // separation of everything but the points, u
    float max_travel;                       // relative motion, u: farther, it is computed again
    CellRange cells;                        // the cells tested
    std::int32_t first_point, point_count;  // range in points
    std::int32_t first_height;              // in heights: one per cell of `cells`, row-major
    // ---- set by build_index()
    const CachedPoint* points = nullptr;
    const float* heights = nullptr;
  };
  // The manifolds found by one chunk of bodies.
  struct ChunkCache {
    std::vector<CachedManifold> manifolds;
    std::vector<CachedPoint> points;
    std::vector<float> heights;
    void archive(common::StateArchive& a) {
      // Pointers are not state: they are null in the bytes and after restoring.
      const auto clear_index = [this] {
        for (CachedManifold& m : manifolds) m.points = nullptr, m.heights = nullptr;
      };
      clear_index();
      a(manifolds, points, heights);
      clear_index();
    }
  };

  // The field must be rectangular, without force limits.
  explicit FieldManifoldCache(const surface::Field& field) : field_(field) {}

  // Takes over a chunk's manifolds of the previous step and empties the list. Call build_index() after all
  // chunks.
  void swap_in(int chunk, ChunkCache&);
  void build_index(int bodies);

  // Appends the contacts of a non-sphere with separations up to `margin`, and stores the manifold for the
  // next step. `previous`: the body's static contacts of the previous step.
  void collide(const BodyStore&, std::size_t body, float margin, std::span<const Contact> previous,
               ChunkCache& chunk_cache, std::vector<Contact>& out) const;

 private:
  struct HeightChange {
    float low, high;
  };

  bool is_valid(const BodyStore&, std::size_t body, const Mat3& axes, float margin,
                const CachedManifold&) const;
  HeightChange height_change_since(const CachedManifold&) const;
  bool level_cells_separated(const CachedManifold&) const;
  void rebuild(const BodyStore&, std::size_t body, float margin, const CellRange& cells, float max_height,
               ChunkCache& chunk_cache) const;
  void reuse(const CachedManifold&, ChunkCache& chunk_cache) const;
  bool reduce(const BodyStore&, std::size_t body, const Mat3& axes, float margin, float slip_limit,
              std::span<const Contact> previous, const ChunkCache& chunk_cache,
              std::vector<Contact>& out) const;

  const surface::Field& field_;
  std::vector<ChunkCache> previous_;  // one per chunk
  BodyMap<const CachedManifold*> manifold_of_body_{nullptr};
};

}  // namespace smartsurf::world
