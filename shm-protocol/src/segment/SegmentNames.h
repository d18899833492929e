// Names of the files in shared memory.
#pragma once

#include <string>

namespace shm_protocol {

inline constexpr const char* kShmDirectory = "/dev/shm";
inline constexpr const char* kFilePrefix = "smartsurf.";  // common to all files of this protocol
inline constexpr char kBuildMarker = '~';                 // NAME~PROCESSWORD.COUNT: under construction

inline std::string file_name(const std::string& name) { return kFilePrefix + name; }

}  // namespace shm_protocol
