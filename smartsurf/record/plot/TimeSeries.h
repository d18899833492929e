// Time series; those of a recording are the curves of `smartsurf plot --what KIND`.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "smartsurf/record/Recording.h"

namespace smartsurf::record {

struct Curve {
  std::string name;
  std::vector<double> values;  // one per frame; NaN where undefined
};

struct TimeSeries {
  std::string title;       // "Speed of the objects"
  std::string axis_title;  // "mean speed [u/s]"
  std::vector<Curve> curves;
  std::optional<double> success_s = {};  // marked by a line
  bool counts = false;                   // whole numbers, on an axis from 0
};

// The kinds with their arguments: "height:ROW,COLUMN…", "speed[:ID…]".
std::vector<std::string> time_series_kinds();
// kind: what stands before the first colon, which may be the name of a recorded channel or metric or its
// beginning. arguments: the parts after it, separated by colons. Throws scene::InputError if the recording
// has no such kind or an argument is invalid.
TimeSeries time_series(const Recording& recording, const std::string& kind,
                       const std::vector<std::string>& arguments);

}  // namespace smartsurf::record
