// Failure to read or write a media file: one line that names the file.
#pragma once

#include <stdexcept>
#include <string>

#include "apron/vm/Host.h"

namespace apron::run {

class MediaError : public std::runtime_error {
 public:
  // kRefused: the file or its name is invalid; kFailed: a system error; kInterrupted: a wait was interrupted.
  MediaError(vm::HostStatus status, const std::string& what) : std::runtime_error(what), status_(status) {}
  vm::HostStatus status() const noexcept { return status_; }

 private:
  vm::HostStatus status_;
};

}  // namespace apron::run
