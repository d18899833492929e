// Compares Life, the census transform and FAST-9 on registers of uint8 with the same programs on floats and
// with hand-written C++, on one thread, in processor time of pairs.
//   bench_integers [SIZE [REPETITIONS]]
#include <time.h>

#include <algorithm>
#include <cstdio>
#include <functional>
#include <memory>
#include <random>
#include <stdexcept>
#include <string>

#include "apron/compiler/Compiler.h"
#include "apron/library/EmbeddedHost.h"
#include "apron/syntax/FileReader.h"
#include "apron/vm/Vm.h"
#include "tests/bench/CommandLine.h"
#include "tests/bench/arrays/IntegerPeers.h"

namespace {

using arrays::ByteImage;
namespace vm = apron::vm;

constexpr int kThreshold = 25;

double thread_time_us() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) * 1e6 + static_cast<double>(now.tv_nsec) * 1e-3;
}

// A program that writes B from A, once per run.
struct Machine {
  apron::library::FrameCountingHost host{[](std::string_view) {}};
  std::unique_ptr<vm::Vm> machine;
  vm::Plane input, output;
  std::size_t result = 0;

  Machine(const std::string& declarations, const std::string& line, int n, vm::InstructionSet isa) {
    apron::syntax::MemoryReader memory;
    apron::syntax::DiskReader disk;
    const std::string library = disk.read(ARRAYS_LIBRARY_DIR "/integers.aps").value_or("");
    memory.files["bench.aps"] =
        library + "\n" + declarations + "\nwhile(1)\n  " + line + "\n  surface.step\nendwhile\n";
    apron::compiler::CompileOptions options;
    options.file = "bench.aps";
    options.width = options.height = static_cast<std::uint32_t>(n);
    apron::compiler::CompileResult compiled = apron::compiler::compile(options, memory);
    if (!compiled.program)
      throw std::runtime_error(apron::syntax::format_diagnostics(compiled.diagnostics, compiled.sources));
    const std::size_t from = *apron::program::find_register(*compiled.program, "A");
    result = *apron::program::find_register(*compiled.program, "B");
    vm::VmOptions vm_options;
    vm_options.isa = isa;
    vm_options.fusion.observed = {false, {}, {static_cast<std::uint32_t>(result)}};
    machine = std::make_unique<vm::Vm>(std::move(*compiled.program), vm_options, host);
    input = machine->plane(from);
  }
  void fill(const ByteImage& image) const {
    vm::with_cell_type(input.type, [&](auto cell) {
      using T = decltype(cell);
      for (int r = 0; r < image.n; ++r)
        std::copy_n(image.row(r), image.n, input.cells<T>(static_cast<std::uint32_t>(r)));
    });
  }
  bool gives(const ByteImage& image) const {
    for (int r = 0; r < image.n; ++r)
      for (int x = 0; x < image.n; ++x)
        if (vm::cell_value(machine->plane(result), static_cast<std::uint32_t>(x),
                           static_cast<std::uint32_t>(r)) != image.row(r)[x])
          return false;
    return true;
  }
};

struct Workload {
  const char* name;
  const char* line;  // of A, to B
  std::function<void(const ByteImage&, ByteImage&)> hand;
  bool of_truths, has_float_form;
};

}  // namespace

int main(int argc, char** argv) {
  int n = 1024, repetitions = 60;
  CLI::App app("Compares programs on integers with floats and C++", "bench_integers");
  app.add_option("size", n, "edge length [1024]")->check(CLI::Range(16, 8192));
  app.add_option("repetitions", repetitions, "repetitions of each measurement [60]")
      ->check(CLI::Range(1, 100000));
  bench::parse_or_exit(app, argc, argv);
  const Workload workloads[] = {
      {"life", "B = (near.sum(A, 8) == 3) or (A and (near.sum(A, 8) == 2))", arrays::hand_life, true, true},
      {"census", "B = census(A)", arrays::hand_census, false, false},
      {"fast9", "B = fast9(A, 25)",
       [](const ByteImage& a, ByteImage& y) { arrays::hand_fast9(a, y, kThreshold); }, false, false}};
  for (const Workload& workload : workloads) {
    ByteImage image(n), expected(n);
    std::mt19937 rng(1);
    for (int r = 0; r < n; ++r)
      for (int x = 0; x < n; ++x) {
        const auto noise = static_cast<std::uint8_t>(rng() % 31);
        image.row(r)[x] = workload.of_truths
                              ? static_cast<std::uint8_t>(rng() % 8 < 3)
                              : static_cast<std::uint8_t>(((x / 10 + r / 7) % 2) * 120 + 60 + noise);
      }
    workload.hand(image, expected);
    for (const vm::InstructionSet isa :
         {vm::InstructionSet::kAvx512, vm::InstructionSet::kAvx2, vm::InstructionSet::kPortable}) {
      if (!vm::is_supported(isa)) continue;
      Machine integers("!uint8(A, B)", workload.line, n, isa);
      std::unique_ptr<Machine> floats;
      if (workload.has_float_form)
        floats = std::make_unique<Machine>("!register(A, B)", workload.line, n, isa);
      integers.fill(image);
      if (floats) floats->fill(image);
      double ours = 1e300, hand = 1e300, of_floats = 1e300;
      for (int i = 0; i <= repetitions; ++i) {
        const double start = thread_time_us();
        integers.machine->run();
        const double middle = thread_time_us();
        workload.hand(image, expected);
        const double end = thread_time_us();
        if (floats) floats->machine->run();
        if (i == 0) continue;
        ours = std::min(ours, middle - start);
        hand = std::min(hand, end - middle);
        of_floats = std::min(of_floats, thread_time_us() - end);
      }
      if (!integers.gives(expected) || (floats && !floats->gives(expected))) {
        std::fprintf(stderr, "%s: the results differ\n", workload.name);
        return 1;
      }
      std::printf("%-7s %-9s %9.1f us   C++ %9.1f us   C++ / ours %5.2f", workload.name,
                  std::string(vm::instruction_set_name(isa)).c_str(), ours, hand, hand / ours);
      if (floats) std::printf("   floats %9.1f us   floats / ours %5.2f", of_floats, of_floats / ours);
      std::puts("");
    }
  }
}
