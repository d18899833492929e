// What the last look at two convex bodies told, and for how long it holds.
//
// Points of contact are kept in the axes of both bodies, and go with them while these hardly move against
// each other. Two that are well apart are not looked at again before they can have met.
#pragma once

#include <vector>

#include "smartsurf/world/BodyStore.h"
#include "smartsurf/world/Contact.h"
#include "smartsurf/world/narrowphase/Gjk.h"

namespace smartsurf::world {

class PairManifoldCache {
 public:
  struct CachedPoint {
    Vec3 on_a, on_b, normal;  // in the axes of a, of b, of b
  };
  struct CachedManifold {
    std::int32_t a, b;
    Mat3 rotation;         // the axes of a, in those of b
    Vec3 translation;      // from b to a, in the axes of b
    float clearance;       // nothing but the points was nearer, u
    float min_separation;  // at the points; infinite without any
    std::int32_t first_point, point_count;
    std::int32_t simplex;  // in features, or −1
    // ---- of the last step's
    const CachedPoint* points = nullptr;
    const SimplexCache* simplex_cache = nullptr;
    const CachedManifold* next = nullptr;  // with the same a
  };
  // Of one chunk of bodies.
  struct ChunkCache {
    std::vector<CachedManifold> manifolds;
    std::vector<CachedPoint> points;
    std::vector<SimplexCache> simplices;
  };

  // Takes over what the last step noted in a chunk's list and leaves the list empty. Then index.
  void swap_in(int chunk, ChunkCache&);
  void build_index(int bodies);

  // Appends the contacts of bodies a and b, neither a sphere, with gaps up to `margin`, the normal pointing
  // from b to a, and notes them for the next step.
  void collide(const BodyStore&, std::size_t a, std::size_t b, float margin, ChunkCache& chunk_cache,
               std::vector<Contact>& out) const;

 private:
  const CachedManifold* find(std::size_t a, std::size_t b) const;

  std::vector<ChunkCache> previous_;                   // one a chunk
  std::vector<const CachedManifold*> first_manifold_;  // of each body a
};

}  // namespace smartsurf::world
