// Names of the files in shared memory.
#pragma once

namespace shm_protocol {

inline constexpr const char* kShmDirectory = "/dev/shm";
inline constexpr const char* kFilePrefix = "smartsurf.";  // common to all files of this protocol
inline constexpr char kBuildMarker = '~';                 // NAME~PROCESSWORD.COUNT: under construction

}  // namespace shm_protocol
