// What the last look at two convex bodies told, and for how long it holds.
//
// Points of contact are kept in the axes of both bodies, and go with them while these hardly move against
// each other. Two that are well apart are not looked at again before they can have met.
#pragma once

#include <vector>

#include "smartsurf/world/BodyStore.h"
#include "smartsurf/world/Contact.h"
#include "smartsurf/world/Gjk.h"

namespace smartsurf::world {

class PairMemory {
 public:
  struct Point {
    Vec3 on_a, on_b, normal;  // in the axes of a, of b, of b
  };
  struct Known {
    std::int32_t a, b;
    Mat3 turn;        // the axes of a, in those of b
    Vec3 apart;       // from b to a, in the axes of b
    float clear;      // nothing but the points was nearer, u
    float least_gap;  // at the points; infinite without any
    std::int32_t first, count;
    std::int32_t feature;  // in features, or −1
    // ---- of the last step's
    const Point* points = nullptr;
    const NearestFeature* nearest = nullptr;
    const Known* next = nullptr;  // with the same a
  };
  // Of one chunk of bodies.
  struct List {
    std::vector<Known> pairs;
    std::vector<Point> points;
    std::vector<NearestFeature> features;
  };

  // Takes over what the last step noted in a chunk's list and leaves the list empty. Then index.
  void take(int chunk, List&);
  void index(int bodies);

  // Appends the contacts of bodies a and b, neither a sphere, with gaps up to `margin`, the normal pointing
  // from b to a, and notes them for the next step.
  void touch(const BodyStore&, std::size_t a, std::size_t b, float margin, List& now,
             std::vector<Contact>& out) const;

 private:
  const Known* find(std::size_t a, std::size_t b) const;

  std::vector<List> old_;            // one a chunk
  std::vector<const Known*> first_;  // of each body a
};

}  // namespace smartsurf::world
