#include "shm_protocol/Segments.h"

#include <algorithm>
#include <vector>

#include "Conversion.h"

using namespace shm_protocol;

static_assert(static_cast<int>(Ownership::kLiving) == SSP_LIVING &&
              static_cast<int>(Ownership::kOrphan) == SSP_ORPHAN &&
              static_cast<int>(Ownership::kForeign) == SSP_FOREIGN);

namespace {

ssp_result copy_out(const std::vector<SegmentInfo>& from, ssp_segment_info* to, size_t capacity,
                    size_t* count) {
  *count = from.size();
  for (std::size_t i = 0; i < std::min(capacity, from.size()); ++i) {
    const SegmentInfo& s = from[i];
    to[i] = {.name = {},
             .bytes = s.bytes,
             .ownership = static_cast<uint32_t>(s.ownership),
             .version_major = s.version_major,
             .version_minor = s.version_minor,
             .surface_pid = s.surface_pid,
             .controller_pid = s.controller_pid,
             .reserved0 = 0,
             .reserved = {}};
    std::memcpy(to[i].name, s.name.data(), std::min(s.name.size(), sizeof to[i].name - 1));
  }
  return SSP_OK;
}

}  // namespace

extern "C" {

ssp_result ssp_list(ssp_segment_info* found, size_t capacity, size_t* count) {
  if (!count || (capacity && !found)) return c::null_argument();
  *count = 0;
  return c::guarded([&] { return copy_out(list_segments(), found, capacity, count); });
}

ssp_result ssp_clean(const char* prefix, ssp_segment_info* removed, size_t capacity, size_t* count) {
  if (!count) return c::null_argument();
  *count = 0;
  return c::guarded(
      [&] { return copy_out(remove_orphans(prefix ? prefix : ""), removed, removed ? capacity : 0, count); });
}

}  // extern "C"
