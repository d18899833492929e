// Records a surface that another process drives: simulator, bridge or fake. Attaches as an observer, so that
// neither side waits for it.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

namespace smartsurf::run {

struct LiveRecordingOptions {
  std::string surface;                     // its name in shared memory
  std::filesystem::path file;              // .h5
  std::optional<std::uint64_t> frames;     // end after so many; nullopt: with the surface
  std::chrono::milliseconds wait{10'000};  // for the surface
  std::string command_line;
};

// Returns the exit status: 0 if the surface closed or the frames were recorded, 3 if it did not come or died,
// 128 + n after a signal. Prints one line of counts. Throws scene::InputError for an unusable file or name,
// std::runtime_error if the file can no longer be written; what was recorded before stays.
int record_live_surface(const LiveRecordingOptions&);

}  // namespace smartsurf::run
