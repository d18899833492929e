// The owner of a file in /dev/shm, read from its first bytes without mapping it, and safe removal.
#pragma once

#include <cstdint>
#include <string>

#include "ProcessIdentity.h"
#include "shm_protocol/Segments.h"

namespace shm_protocol {

// `file` is a file's name within /dev/shm, beginning with "smartsurf.". Missing or unreadable: kForeign.
SegmentInfo inspect_segment(const std::string& file);

// Removes the file if, under a lock on that very file, it is an orphan. False when it was not or is gone.
bool remove_if_orphan(const std::string& file);

}  // namespace shm_protocol
