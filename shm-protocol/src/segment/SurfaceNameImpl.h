// The parts of a reservation.
#pragma once

#include <sys/types.h>

#include <functional>
#include <string>

#include "FileDescriptor.h"
#include "shm_protocol/SurfaceName.h"

namespace shm_protocol {

struct SurfaceName::Impl {
  std::string name;
  std::string path;            // of the final name
  std::string temporary_path;  // of the private name, until renamed into place
  bool in_place = false;
  FileDescriptor file;
  pid_t builder = 0;
  std::function<void()> put_in_place_elsewhere, remove_elsewhere;  // empty: this object does it
};

}  // namespace shm_protocol
