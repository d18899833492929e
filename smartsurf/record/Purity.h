// Measures how well the objects are sorted by size: purity(t) is the share of the objects in their own half
// of the surface, small ones west of its centre line and large ones east (docs/recordings.md).
//
// Definitions:
//   Objects   Those that exist, are not `fixed`, and belong to one of the two classes.
//   Classes   If the objects have exactly two different labels, these are the classes. The one with the
//             smaller mean size is "small" (at equal means, the alphabetically first); unlabelled objects
//             have no class. Otherwise objects below the midpoint between the smallest and the largest size
//             are small, the others large. If all sizes are equal, there are no classes and no purity.
//   Size      The radius of a sphere, cylinder, capsule or cone; for a box, or the bounding box of a solid,
//             half the mean of its x and y edges.
//   Own half  The origin lies, in x and y, within the outline of the surface's cells and on the
//             side of the object's class. The centre line is midway between the outline's west and east ends
//             (in a rectangular grid, x = (columns − 1)·pitch/2). Objects on the line or off the surface are
//             in neither half.
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

double object_size(const scene::ObjectSpec& object);  // u
// Returns one class per object.
std::vector<SizeClass> classify_objects(const std::vector<scene::ObjectSpec>& catalogue);

struct PuritySeries {
  std::vector<double> times;        // s, one per recorded frame
  std::vector<double> values;       // [0, 1]; NaN if no object counts
  std::optional<double> sorted_at;  // s
};

// Computes the purity of a recording; the classes are those of all objects ever created. Throws
// scene::InputError if the recording has no poses or its objects do not form two classes.
PuritySeries compute_purity(const Recording& recording);

// Measures the purity of a live run. add() allocates only when the catalogue has grown; it then reclassifies
// all objects created so far.
class PurityMeter {
 public:
  explicit PurityMeter(const scene::SurfaceSpec& surface);

  // Call once per tick, in order of time. catalogue: every object ever created, index = id.
  void add(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue);

  // [0, 1] at the last tick added; NaN if no object counts, or before the first tick.
  double value() const { return value_; }
  // The start of the first sorted interval, s; nullopt until it has lasted 5 s.
  std::optional<double> sorted_at() const { return sorted_at_; }

 private:
  friend PuritySeries compute_purity(const Recording& recording);
  void add_value(double time_s, double value);

  scene::TableFootprint footprint_;
  double centre_x_;  // x of the centre line, u
  std::vector<SizeClass> classes_;
  double value_ = std::numeric_limits<double>::quiet_NaN();
  std::optional<double> above_threshold_since_, sorted_at_;
};

}  // namespace smartsurf::record
