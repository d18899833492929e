// How a program ends where no exception may leave: in a destructor, in a library's noexcept function, or in a C library that
// does not expect an allocation to fail.
#pragma once

namespace common {

// Lives in main(). While it does, a failed allocation ends the process with one line, kFailed and without its unfinished files
// (UnfinishedFile.h) where
//   std::terminate() is called because of it,
//   a library crashes or aborts, the last error of its thread being ENOMEM,
//   a library calls exit().
// Any other exception or crash is a bug and ends the process as ever. `program` begins the line and must outlive the process.
class Termination {
 public:
  explicit Termination(const char* program) noexcept;
  ~Termination();
  Termination(const Termination&) = delete;
  Termination& operator=(const Termination&) = delete;
};

// Ends the process at once and without its unfinished files, for work that cannot be interrupted. `reason` is its line;
// null: none. Only while a Termination lives; any thread.
[[noreturn]] void end_process(const char* reason, int status) noexcept;

}  // namespace common
