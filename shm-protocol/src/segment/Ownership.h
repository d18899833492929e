// Determines the owner of a file in /dev/shm from its header without mapping it, and removes orphans safely.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "FileDescriptor.h"
#include "ProcessIdentity.h"
#include "shm_protocol/Segments.h"

namespace shm_protocol {

// `file` is a name within /dev/shm that begins with "smartsurf.". Missing or unreadable: kForeign.
SegmentInfo inspect_segment(const std::string& file);

// The names of the files in /dev/shm that begin with `prefix`.
std::vector<std::string> files_in_shm(const std::string& prefix);

// Takes the exclusive lock that serialises the removers of a file. False if another process holds it for
// longer than a remover needs.
bool lock_within_bound(int descriptor) noexcept;

// Removes the file if it is an orphan, checked under a lock on the file. False if it is not an orphan, is
// gone or stays locked.
bool remove_if_orphan(const std::string& file);

}  // namespace shm_protocol
