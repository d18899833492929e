// Divides the objects of an experiment into small and large ones.
#pragma once

#include <vector>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::record {

enum class SizeClass : signed char { kNone, kSmall, kLarge };

// The radius of a sphere, cylinder, capsule or cone; for a box, or the bounding box of a solid, half the mean
// of its x and y edges. u
double object_size(const scene::ObjectSpec& object);

// Returns one class per object; `fixed` objects have none. If the objects have exactly two different labels,
// these are the classes, and unlabelled objects have none: the label with the smaller mean size is small (at
// equal means, the alphabetically first). Otherwise objects below the midpoint between the smallest and the
// largest size are small, the others large. If all sizes are equal, there are no classes.
std::vector<SizeClass> classify_objects(const std::vector<scene::ObjectSpec>& catalogue);

}  // namespace smartsurf::record
