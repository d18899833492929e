// The file in /dev/shm and its mapping: creation, renaming into place, opening, reclaiming and removal.
//
// A segment appears under its final name only when it is complete: it is built as
// smartsurf.NAME~PROCESSWORD.COUNT and renamed without replacing another. That name identifies the file of a
// builder that was killed.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "LivenessLock.h"
#include "ProcessIdentity.h"
#include "SegmentNames.h"
#include "shm_protocol/SurfaceName.h"

namespace shm_protocol {

// "/dev/shm/smartsurf.NAME"
std::string path_of(const std::string& name);
// Throws Error(kSystem) with the description of an errno.
[[noreturn]] void system_error(const std::string& what, int number);

enum class Access { kReadWrite, kReadOnly };

class Segment {
 public:
  // Makes a zeroed segment of the reserved file, with its memory reserved. Throws Error(kSystem).
  static Segment create(std::shared_ptr<SurfaceName>, std::size_t bytes);
  // Maps an existing segment; nothing if there is none. Throws Error(kSystem) if it cannot be mapped, or
  // kCorrupt if it is empty.
  static std::optional<Segment> open(const std::string& name, Access = Access::kReadWrite);
  ~Segment();  // unmaps; SurfaceName removes a file that was never renamed into place
  Segment(Segment&&) noexcept;
  Segment& operator=(Segment&&) noexcept;

  // Gives the segment its final name, reclaiming one left by a dead surface. Throws Error: kSurfaceLives,
  // kForeign, kSystem.
  void rename_into_place();
  // Removes the file if it is still this segment's.
  void remove() noexcept;

  // The locks of both sides. A created segment holds that of the surface.
  LivenessLock& liveness() noexcept;
  // False once the name no longer refers to this segment: somebody has removed the file.
  bool is_in_place() const noexcept;

  std::span<std::byte> bytes() noexcept;  // a write to a read-only mapping is a SIGSEGV

 private:
  struct Impl;
  explicit Segment(std::unique_ptr<Impl>);
  std::unique_ptr<Impl> impl_;
};

// Removes the segment of a dead surface. Throws Error: kSurfaceLives with the pid, or kForeign, if the name
// is in use.
void reclaim_or_throw(const std::string& name);

}  // namespace shm_protocol
