// The file in /dev/shm and its mapping: created complete under a private name, renamed into place, opened,
// reclaimed from the dead and removed.
//
// A segment appears under its real name only when it is complete: it is built as
// smartsurf.NAME~PROCESSWORD.COUNT and renamed without replacing. A builder that is killed leaves only a name
// that identifies it.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "ProcessIdentity.h"

namespace shm_protocol {

inline constexpr const char* kShmDirectory = "/dev/shm";
inline constexpr const char* kFilePrefix = "smartsurf.";  // of every file of this protocol
inline constexpr char kBuildMarker = '~';                 // NAME~PROCESSWORD.COUNT: being built

// "/dev/shm/smartsurf.NAME"
std::string path_of(const std::string& name);

enum class Access { kReadWrite, kReadOnly };

class Segment {
 public:
  // A zeroed segment under a private name, with its memory reserved. Throws Error(kSystem).
  static Segment create(const std::string& name, std::size_t bytes, ProcessIdentity owner);
  // Maps an existing segment whole. Nothing when there is none; throws Error(kSystem) when it cannot be
  // mapped.
  static std::optional<Segment> open(const std::string& name, Access = Access::kReadWrite);
  ~Segment();  // unmaps; removes only what was never put in place
  Segment(Segment&&) noexcept;
  Segment& operator=(Segment&&) noexcept;

  // Gives the built segment its real name, reclaiming one that a dead surface left. Throws Error:
  // kSurfaceLives, kForeign, kSystem.
  void rename_into_place();
  // Removes the file if it still is this segment's.
  void remove() noexcept;

  std::span<std::byte> bytes() noexcept;  // writing to what was opened read-only ends the process

 private:
  struct Impl;
  explicit Segment(std::unique_ptr<Impl>);
  std::unique_ptr<Impl> impl_;
};

// Throws Error(kSurfaceLives) naming the pid, or kForeign, when the name is taken for good; removes the
// segment of a dead surface.
void reclaim_or_throw(const std::string& name);

}  // namespace shm_protocol
