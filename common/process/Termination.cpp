#include "common/process/Termination.h"

#include <unistd.h>

#include <cstddef>
#include <cstdlib>
#include <exception>
#include <new>

#include "common/process/ExitStatus.h"
#include "common/text/Printable.h"

namespace common {
namespace {

constexpr std::size_t kExceptionBytes = 4096;

const char* program_name = "";

[[noreturn]] void on_terminate() {
  try {
    if (const std::exception_ptr current = std::current_exception()) std::rethrow_exception(current);
  } catch (const std::bad_alloc& error) {
    print_error_line(program_name, failure_text(error));
    ::_exit(kFailed);
  } catch (...) {
  }
  // Without memory not even an exception can be thrown.
  if (!std::current_exception() && std::malloc(kExceptionBytes) == nullptr) {
    print_error_line(program_name, failure_text(std::bad_alloc()));
    ::_exit(kFailed);
  }
  std::abort();
}

}  // namespace

void report_exhausted_memory(const char* program) noexcept {
  program_name = program;
  std::set_terminate(on_terminate);
}

}  // namespace common
