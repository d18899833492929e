#include "common/process/Termination.h"

#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstddef>
#include <cstdlib>
#include <exception>
#include <new>

#include "common/files/UnfinishedFile.h"
#include "common/process/ExitStatus.h"
#include "common/text/Printable.h"

namespace common {
namespace {

constexpr std::size_t kExceptionBytes = 4096;
constexpr std::array kCrashes{SIGSEGV, SIGBUS, SIGABRT};

const char* program_name = "";
std::atomic<bool> in_main{false};
std::array<struct sigaction, kCrashes.size()> earlier_actions;

[[noreturn]] void end_without_memory() noexcept { end_process(failure_text(std::bad_alloc()), kFailed); }

[[noreturn]] void on_terminate() {
  try {
    if (const std::exception_ptr current = std::current_exception()) std::rethrow_exception(current);
  } catch (const std::bad_alloc&) {
    end_without_memory();
  } catch (...) {
    errno = 0;
    std::abort();
  }
  // There is no current exception: one left a destructor, or there was no memory to throw it.
  if (errno == ENOMEM || std::malloc(kExceptionBytes) == nullptr) end_without_memory();
  errno = 0;
  std::abort();
}

extern "C" void on_crash(int signal, siginfo_t* cause, void*) {
  if (signal == SIGBUS && cause->si_code == BUS_ADRERR)  // the file that is mapped there has no such page
    end_process("another process has cut the shared memory", kFailed);
  if (errno == ENOMEM) end_without_memory();
  for (std::size_t i = 0; i < kCrashes.size(); ++i)
    if (kCrashes[i] == signal) ::sigaction(signal, &earlier_actions[i], nullptr);
  // A signal that a process sent is raised again; one that an instruction caused occurs again by itself.
  if (cause->si_code <= 0) ::raise(signal);
}

extern "C" void on_exit_in_main() {
  if (!in_main.load()) return;
  if (errno == ENOMEM) end_without_memory();
  end_process("a library has ended the process", kFailed);
}

}  // namespace

Termination::Termination(const char* program) noexcept {
  program_name = program;
  std::set_terminate(on_terminate);
  // HDF5 may overflow the stack by endless recursion, so the handler needs its own. A sanitizer brings one.
  static std::array<std::byte, std::size_t{1} << 16> handler_stack;
  stack_t stack{};
  if (::sigaltstack(nullptr, &stack) == 0 && (stack.ss_flags & SS_DISABLE) != 0) {
    stack = {.ss_sp = handler_stack.data(), .ss_flags = 0, .ss_size = handler_stack.size()};
    ::sigaltstack(&stack, nullptr);
  }
  struct sigaction action {};
  action.sa_sigaction = on_crash;
  action.sa_flags = SA_SIGINFO | SA_ONSTACK;
  for (std::size_t i = 0; i < kCrashes.size(); ++i) ::sigaction(kCrashes[i], &action, &earlier_actions[i]);
  in_main.store(true);
  std::atexit(on_exit_in_main);
}

Termination::~Termination() { in_main.store(false); }

void end_process(const char* reason, int status) noexcept {
  if (reason != nullptr) print_error_line(program_name, reason);
  remove_unfinished_files();
  ::_exit(status);
}

}  // namespace common
