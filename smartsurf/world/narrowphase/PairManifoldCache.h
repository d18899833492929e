// Caches the manifolds of pairs of convex bodies.
//
// Contact points are stored in the axes of both bodies and reused while the relative motion is small. A pair
// that is well separated is not tested again before it can have met.
#pragma once

#include <span>
#include <vector>

#include "smartsurf/world/body/BodyMap.h"
#include "smartsurf/world/body/BodyStore.h"
#include "smartsurf/world/contact/Contact.h"
#include "smartsurf/world/narrowphase/Gjk.h"

namespace smartsurf::world {

class PairManifoldCache {
 public:
  // Separations are computed up to this much beyond the margin, so that separated pairs can be skipped in
  // later steps, u. Pairs that are farther apart need not be passed to collide().
  static constexpr float kHorizon = 0.2F;

  struct CachedPoint {
    Vec3 on_a, on_b, normal;  // in the axes of a, b and b
  };
  struct CachedManifold {
    std::int32_t a, b;
    Mat3 rotation;              // axes of a in those of b
    Vec3 translation;           // from b to a, in the axes of b
    float clearance;            // separation of everything but the points, u
    float min_separation;       // of the points, u; infinity without any
    float twist_friction_loss;  // of the points
    std::int32_t first_point, point_count;
    std::int32_t simplex;    // index in simplices, or −1
    float gap;               // least distance between two of the points, on a, u; infinity if there are none
    std::uint32_t touching;  // the points that had contacts, one per bit; none of more than 32
    // ---- set by build_index()
    const CachedPoint* points = nullptr;
    const SimplexCache* simplex_cache = nullptr;
    const CachedManifold* next = nullptr;  // next manifold with the same a
  };
  // The manifolds found by one chunk of bodies.
  struct ChunkCache {
    std::vector<CachedManifold> manifolds;
    std::vector<CachedPoint> points;
    std::vector<SimplexCache> simplices;
    // The chunk's manifolds of the previous step, and the position after the one found last: pairs come in
    // much the same order in each step, so that the next one is usually there. Set by swap_in().
    std::span<const CachedManifold> previous;
    std::size_t expected = 0;
    void archive(common::StateArchive& a) {
      // Pointers are not state: they are null in the bytes and after restoring.
      const auto clear_index = [this] {
        for (CachedManifold& m : manifolds) m.points = nullptr, m.simplex_cache = nullptr, m.next = nullptr;
      };
      clear_index();
      a(manifolds, points, simplices);
      clear_index();
    }
  };

  // The points of a manifold that have contacts now, in their order, and that had some in the last step, one
  // per bit, if the manifold was kept; none of `touched` if not. `gap`: see CachedManifold.
  struct Points {
    std::uint32_t touching = 1, touched = 0;
    float gap = 0.0F;
  };

  // Takes over a chunk's manifolds of the previous step and empties the list. Call build_index() after all
  // chunks.
  void swap_in(int chunk, ChunkCache&);
  void build_index(int bodies);

  // Appends the contacts of bodies a and b, neither a sphere, with separations up to `margin` and normals
  // from b to a, and stores the manifold for the next step.
  Points collide(const BodyStore&, std::size_t a, std::size_t b, float margin, ChunkCache& chunk_cache,
                 std::vector<Contact>& out) const;

 private:
  const CachedManifold* find(std::size_t a, std::size_t b, ChunkCache& chunk_cache) const;

  std::vector<ChunkCache> previous_;                        // one per chunk
  BodyMap<const CachedManifold*> first_manifold_{nullptr};  // by body a
};

}  // namespace smartsurf::world
