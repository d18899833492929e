// The output of shm_dump, as text for an 80-column terminal and as JSON.
#pragma once

#include <shm_protocol/Segments.h>

#include <string>
#include <vector>

#include "SurfaceStatus.h"

namespace shm_protocol::dump {

enum class ArrayDisplay { kNone, kNumbers, kMap };

struct Format {
  ArrayDisplay arrays = ArrayDisplay::kNone;
  std::vector<std::string> channels;  // channels whose arrays are shown; empty: all
  bool all_numbers = false;           // false: a large array is reduced to its corners
  bool colour = false;
  int width = 80;
};

std::string text_report(const SurfaceStatus&, const ObserverEndpoint&, const Format&);
// A JSON object; on a single line if `compact`.
std::string json_report(const SurfaceStatus&, const ObserverEndpoint&, const Format&, bool compact);

std::string text_list(const std::vector<SegmentInfo>&);
std::string json_list(const std::vector<SegmentInfo>&);

bool is_wanted(const Format&, const ChannelSpec&);

}  // namespace shm_protocol::dump
