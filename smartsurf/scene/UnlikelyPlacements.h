// Finds objects that an experiment has probably placed by mistake.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/scene/SurfaceBounds.h"

namespace smartsurf::scene {

// The faults of the place of one object, at rest or not.
class PlacementCheck {
 public:
  enum class Kind { kLarge, kSmall, kBeside, kBelow, kAmong, kWalled };
  static constexpr std::size_t kKinds = 6;
  struct Mistake {
    Kind kind;
    std::string line;
  };

  // The surface must outlive the check. O(cells).
  explicit PlacementCheck(const SurfaceSpec&);
  // nullopt: nothing. Objects with joints may be anywhere, which the caller knows.
  std::optional<Mistake> operator()(const ObjectSpec&, std::size_t id) const;

 private:
  const SurfaceSpec& surface_;
  SurfaceBounds bounds_;
  double lowest_top_;
  bool is_solid_;  // has a cell everywhere, and no skin
};

// One line for each kind of mistake, with the first such object and the number of the others: larger than the
// table; smaller than the holes between four cells; beside the table; below the cells; at least partly inside
// them, or inside their border; inside another object at the start. Fixed objects, those with joints and
// those in motion may be anywhere, and objects may touch. Only what certainly overlaps is reported: spheres,
// boxes and capsules are exact, the other shapes count by what they contain, and only a million of pairs are
// tested. O(n log n) for objects that are spread over the table.
std::vector<std::string> unlikely_placements(const SceneSpec&);

}  // namespace smartsurf::scene
