// The name of a surface, reserved before its size is known. For a surface that gives up its right to create,
// rename and remove files before it reads what decides the size: another process that shares the reservation
// does both.
#pragma once

#include <functional>
#include <memory>
#include <string>

namespace shm_protocol {

class SurfaceName {
 public:
  // Creates the empty file that becomes the segment. Reclaims a segment that a dead surface left under that
  // name. Throws Error: kBadConfig, kSurfaceLives, kForeign, kSystem.
  explicit SurfaceName(const std::string& name);
  ~SurfaceName();  // in the process that reserved it: removes the file
  SurfaceName(const SurfaceName&) = delete;
  SurfaceName& operator=(const SurfaceName&) = delete;

  const std::string& name() const noexcept;
  // The file until it gets its name; the surface must be able to open it for writing.
  const std::string& file() const noexcept;

  // Gives the file its name. Throws Error: kSurfaceLives, kForeign, kSystem.
  void put_in_place();
  // Removes the file if it has the name, and has not been replaced.
  void remove() noexcept;

  // From here on put_in_place() and remove() call these, which reach a forked process's copy of this object.
  void delegate(std::function<void()> put_in_place, std::function<void()> remove);

 private:
  friend class Segment;
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace shm_protocol
