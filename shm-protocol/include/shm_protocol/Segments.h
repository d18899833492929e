// Lists the segments in /dev/shm with their owners, and removes those of dead surfaces.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace shm_protocol {

enum class Ownership {
  kLiving,   // its surface is running
  kOrphan,   // its surface is dead; the segment may be removed
  kForeign,  // not a segment of this protocol, or another user's, unless root asks; never removed
};

struct SegmentInfo {
  std::string name;  // the file is /dev/shm/smartsurf.NAME; NAME~… is under construction
  std::uint64_t bytes = 0;
  Ownership ownership = Ownership::kForeign;
  std::uint16_t version_major = 0, version_minor = 0;
  std::uint32_t surface_pid = 0;
  std::uint32_t controller_pid = 0;  // 0: none, or dead
  std::uint32_t user = 0;            // id of the file's owner
};

// All files of this protocol in /dev/shm, sorted by name.
std::vector<SegmentInfo> list_segments();

// Removes every orphan whose name begins with `prefix` and returns the removed ones. The owner's death is
// verified under the segment's lock, so that concurrent cleaners, or a cleaner and a starting surface, never
// remove the segment of a living surface.
std::vector<SegmentInfo> remove_orphans(const std::string& prefix = "");
// Likewise what dead surfaces of exactly that name have left, complete or under construction. Returns true if
// no file of the name is left: false if a surface of that name lives, or another cleaner is at work.
bool remove_orphans_of(const std::string& name);

}  // namespace shm_protocol
