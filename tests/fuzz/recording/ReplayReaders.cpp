// Passes every file of the corpus, and seeded changes of them, to the fuzz target, without libFuzzer.
//
//   recording_replay ROUNDS FILE|FOLDER…
//
// HDF5 1.10 crashes on some damaged files; the programs read in a process that may (ReadWorker.h). A child
// reads here, and a crash counts where the library's own code is the innermost of the stack but for the C
// library; any other fails.
#include <dlfcn.h>
#include <execinfo.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "common/process/ChildWork.h"
#include "tests/fuzz/recording/Damage.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace {

namespace fs = std::filesystem;
using Input = std::vector<std::uint8_t>;

constexpr int kCrashOfLibrary = 87;
constexpr itimerval kPatience = {{0, 0}, {60, 0}};  // of processor time, for an input

#ifdef __SANITIZE_ADDRESS__

extern "C" void __asan_set_error_report_callback(void (*)(const char*));

// The report's first stack tells, innermost frame first, one a line: "    #1 0x… in NAME (FILE+0x…)".
bool crashed_in_hdf5(std::string_view report) {
  const auto is_of_c = [](std::string_view frame) {
    return std::ranges::any_of(
        std::initializer_list<const char*>{"compiler-rt", "libclang_rt", "libc.so", "sysdeps"},
        [&](const char* name) { return frame.find(name) != frame.npos; });
  };
  for (std::size_t at = report.find("    #0 "); at != report.npos && at < report.size();) {
    const std::size_t end = std::min(report.find('\n', at), report.size());
    const std::string_view frame = report.substr(at, end - at);
    if (!frame.starts_with("    #")) return false;
    if (!is_of_c(frame)) return frame.find("libhdf5") != frame.npos;
    at = end + 1;
  }
  return false;
}

void watch_crashes() {
  __asan_set_error_report_callback([](const char* report) {
    if (crashed_in_hdf5(report)) ::_exit(kCrashOfLibrary);
  });
}

#else

bool is_in(const void* address, std::initializer_list<const char*> libraries) {
  Dl_info info{};
  if (::dladdr(address, &info) == 0 || info.dli_fname == nullptr) return false;
  const std::string_view file = info.dli_fname;
  return std::ranges::any_of(libraries, [&](const char* name) { return file.find(name) != file.npos; });
}

bool manages_heap(const void* address) {
  Dl_info info{};
  if (::dladdr(address, &info) == 0 || info.dli_sname == nullptr) return false;
  const std::string_view function = info.dli_sname;
  return function.find("alloc") != function.npos || function.find("free") != function.npos;
}

// Called where a crash is handled, on top of the stack that crashed. A heap that malloc() or free() finds
// corrupt counts as HDF5's work: whether it is tells AddressSanitizer.
bool crashed_in_hdf5() {
  void* frames[64];
  const int count = ::backtrace(frames, static_cast<int>(std::size(frames)));
  const auto is_of_c = [](const void* frame) {
    return is_in(frame, {"libc.so", "libgcc_s", "linux-vdso", "libstdc++"});
  };
  int i = 0;
  while (i < count && !is_of_c(frames[i])) ++i;  // the handler's own
  for (; i < count && is_of_c(frames[i]); ++i)
    if (manages_heap(frames[i])) return true;
  return i < count && is_in(frames[i], {"libhdf5"});
}

extern "C" void handle_crash(int signal) {
  if (crashed_in_hdf5()) ::_exit(kCrashOfLibrary);
  ::signal(signal, SIG_DFL);
  ::raise(signal);
}

void watch_crashes() {
  common::limit_address_space(std::size_t{2} << 30);
  static std::array<char, 1 << 16> stack;
  const stack_t alternative{.ss_sp = stack.data(), .ss_flags = 0, .ss_size = stack.size()};
  ::sigaltstack(&alternative, nullptr);
  struct sigaction action {};
  action.sa_handler = handle_crash;
  action.sa_flags = SA_ONSTACK;
  for (const int crash : {SIGSEGV, SIGBUS, SIGABRT, SIGFPE, SIGILL}) ::sigaction(crash, &action, nullptr);
}

#endif

std::vector<Input> corpus(int argc, char** argv) {
  std::vector<fs::path> files;
  for (int i = 2; i < argc; ++i) {
    if (!fs::is_directory(argv[i]))
      files.emplace_back(argv[i]);
    else
      for (const auto& entry : fs::directory_iterator(argv[i])) files.push_back(entry.path());
  }
  std::ranges::sort(files);
  std::vector<Input> inputs;
  for (const fs::path& file : files) {
    std::ifstream in(file, std::ios::binary);
    inputs.emplace_back(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
  }
  return inputs;
}

// Another reader of an input's damage, or of one to four changes of any kind.
Input mutate(Input input, std::mt19937& random) {
  input.resize(std::max<std::size_t>(input.size(), 2));
  input[1] = static_cast<std::uint8_t>(random());
  if (random() % 4 == 0) return input;
  input.resize(2 + (random() % 4 + 1) * fuzz::kChangeBytes);
  input[0] = static_cast<std::uint8_t>(random());
  for (std::size_t at = 2; at < input.size(); ++at) input[at] = static_cast<std::uint8_t>(random());
  // Large numbers, small ones and ones.
  for (std::size_t at = 2; at < input.size(); at += fuzz::kChangeBytes)
    if (const unsigned kind = random() % 4; kind < 3)
      std::fill_n(input.begin() + static_cast<std::ptrdiff_t>(at) + 5, 7, kind == 1 ? 0xFF : 0);
  return input;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) return 2;
  std::vector<Input> inputs = corpus(argc, argv);
  if (inputs.empty()) return std::fprintf(stderr, "%s: no corpus\n", argv[2]), 2;
  std::mt19937 random(2024);
  for (int round = std::atoi(argv[1]); round > 0; --round)
    inputs.push_back(mutate(inputs[random() % inputs.size()], random));
  int of_library = 0, faults = 0;
  void* loads_the_library[1];
  ::backtrace(loads_the_library, 1);  // allocates the first time
  const Input whole = {0, 0};
  LLVMFuzzerTestOneInput(whole.data(), whole.size());  // records what is damaged
  // HDF5 may corrupt the heap and go on, so that no input may follow another in a process.
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    const pid_t child = ::fork();
    if (child < 0) return std::perror("fork"), 2;
    if (child == 0) {
      watch_crashes();
      ::setitimer(ITIMER_PROF, &kPatience, nullptr);
      LLVMFuzzerTestOneInput(inputs[i].data(), inputs[i].size());
      ::_exit(0);
    }
    int status = 0;
    ::waitpid(child, &status, 0);
    if (status == 0) continue;
    const bool is_of_library = WIFEXITED(status) && WEXITSTATUS(status) == kCrashOfLibrary;
    ++(is_of_library ? of_library : faults);
    std::printf("input %zu: %s (wait status %d):", i, is_of_library ? "HDF5 crashes" : "fault", status);
    for (const std::uint8_t byte : inputs[i]) std::printf(" %02x", byte);
    std::printf("\n");
  }
  std::printf("%zu inputs, %d crashes of HDF5, %d faults\n", inputs.size(), of_library, faults);
  return faults > 0 ? 1 : 0;
}
