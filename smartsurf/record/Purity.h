// How well the objects are sorted by size: purity(t) is the share of the objects in their own half of the surface,
// small ones west of its centre line and large ones east (docs/recordings.md).
//
// Definitions:
//   Objects   those that exist, are not `fixed`, and belong to one of two classes.
//   Classes   If the objects carry exactly two different labels, these are the classes; the one with the smaller mean
//             size is "small" (at equal sizes, the first in the alphabet), and objects without a label belong to none.
//             Otherwise by size: below the middle between the smallest and the largest size an object is small, else
//             large; if all sizes are equal there are no classes and no purity.
//   Size      The radius of a sphere, cylinder, capsule or cone; for a box, or the bounding box of a solid, half the
//             mean of its x and y edges.
//   Own half  The centre of mass lies, in x and y, within the outline of the surface's cells and on its side of the
//             centre line, the middle between the outline's west and east ends (in a rectangular grid,
//             x = (columns − 1)·pitch/2). Objects on the line or off the surface are in neither half.
//   Sorted    purity ≥ 0.95 now and at every later sample for 5 s; sorted_at is the first such time.
#pragma once

#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/scene/TableFootprint.h"

namespace smartsurf::record {

class Recording;

constexpr double kSortedThreshold = 0.95;
constexpr double kSortedHold_s = 5.0;

enum class SizeClass : signed char { kNone, kSmall, kLarge };

double object_size(const scene::ObjectSpec& object);  // as defined above, u
std::vector<SizeClass> classify_objects(const std::vector<scene::ObjectSpec>& catalogue);  // one an object

struct PuritySeries {
  std::vector<double> times;   // seconds, one entry a recorded frame
  std::vector<double> values;  // [0, 1]; NaN when no object counted
  std::optional<double> sorted_at;
};

// The purity of a recording, with the classes of all its objects. Throws scene::InputError when it holds no
// poses or its objects make no two classes.
PuritySeries compute_purity(const Recording& recording);

// Measures a run while it goes on. add() allocates only when the catalogue has grown; then the classes are
// found anew from all objects created so far.
class PurityMeter {
 public:
  explicit PurityMeter(const scene::SurfaceSpec& surface);

  // Once a tick, in the order of time. catalogue: every object ever created, index = id.
  void add(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue);

  // [0, 1] at the last added tick; NaN when no object counted, or before the first tick.
  double value() const { return value_; }
  // The time since which the surface is or was sorted; none until that has held for 5 s.
  std::optional<double> sorted_at() const { return sorted_at_; }

 private:
  friend PuritySeries compute_purity(const Recording& recording);
  void add_value(double time_s, double value);

  scene::TableFootprint footprint_;
  double centre_x_;  // x of the line between the halves, u
  std::vector<SizeClass> classes_;
  double value_ = std::numeric_limits<double>::quiet_NaN();
  std::optional<double> above_threshold_since_, sorted_at_;
};

}  // namespace smartsurf::record
