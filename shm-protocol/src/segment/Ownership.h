// Determines the owner of a file in /dev/shm from its header without mapping it, and removes orphans safely.
#pragma once

#include <cstdint>
#include <string>

#include "ProcessIdentity.h"
#include "shm_protocol/Segments.h"

namespace shm_protocol {

// `file` is a name within /dev/shm that begins with "smartsurf.". Missing or unreadable: kForeign.
SegmentInfo inspect_segment(const std::string& file);

// Removes the file if it is an orphan, checked under a lock on the file. False if it is no orphan or is gone.
bool remove_if_orphan(const std::string& file);

}  // namespace shm_protocol
