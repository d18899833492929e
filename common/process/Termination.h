// Ends a program in order where no exception may leave: in a destructor, in a library's noexcept function, or
// in a C library that does not expect an allocation to fail.
#pragma once

namespace common {

// Lives in main(). While it lives, a failed allocation prints one line, removes the unfinished files
// (UnfinishedFile.h) and ends the process with kFailed, if
//   std::terminate() is called because of it,
//   a library crashes or aborts while its thread's errno is ENOMEM, or
//   a library calls exit();
// so does an access to shared memory that another process has cut. Any other exception or crash is a bug and
// is handled as without this object. `program` begins the line and must outlive the process.
class Termination {
 public:
  explicit Termination(const char* program) noexcept;
  ~Termination();
  Termination(const Termination&) = delete;
  Termination& operator=(const Termination&) = delete;
};

// Removes the unfinished files and ends the process at once, for work that cannot be interrupted. `reason` is
// the line to print; null: none. May be called on any thread while a Termination lives.
[[noreturn]] void end_process(const char* reason, int status) noexcept;

}  // namespace common
