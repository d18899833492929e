// Time series of a recording: the curves of `smartsurf plot --what KIND`. Internal to this module.
#pragma once

#include <string>
#include <vector>

#include "smartsurf/record/Recording.h"

namespace smartsurf::record {

struct Curve {
  std::string name;
  std::vector<double> values;  // one entry a frame; NaN where there is none
};

struct TimeSeries {
  std::string title;       // "Speed of the objects"
  std::string axis_title;  // "mean speed [u/s]"
  std::vector<Curve> curves;
};

// The kinds with what they take after the colon: "height:ROW,COLUMN", "speed[:ID]".
std::vector<std::string> time_series_kinds();
// kind: the name before the first colon; arguments: what stands between the colons after it. A channel's name
// is a kind too. Throws scene::InputError when there is no such kind in this recording, or an argument is
// wrong.
TimeSeries time_series(const Recording& recording, const std::string& kind,
                       const std::vector<std::string>& arguments);

}  // namespace smartsurf::record
