#include <stdexcept>

#include "apron/compiler/Compiler.h"
#include "apron/syntax/FileReader.h"
#include "apron/vm/Vm.h"
#include "tests/bench/arrays/Peers.h"

namespace arrays {
namespace {

using apron::vm::ConstPlane;
using apron::vm::HostStatus;
using apron::vm::Plane;

// A host without a surface, whose calls return at once.
class NullHost final : public apron::vm::Host {
 public:
  void print(std::string_view) override {}
  HostStatus open_array(std::string_view, Plane) override { return HostStatus::kFailed; }
  HostStatus save_array(std::string_view, ConstPlane) override { return HostStatus::kFailed; }
  HostStatus open_image(std::string_view, Plane) override { return HostStatus::kFailed; }
  HostStatus save_image(std::string_view, ConstPlane) override { return HostStatus::kFailed; }
  HostStatus sense(std::string_view, Plane) override { return HostStatus::kFailed; }
  HostStatus actuate(std::string_view, ConstPlane) override { return HostStatus::kOk; }
  HostStatus actuate(std::string_view, float) override { return HostStatus::kOk; }
  HostStatus step() override { return HostStatus::kOk; }
  std::optional<double> time_s() const override { return 0.0; }
  std::optional<double> dt_s() const override { return 0.0; }
  std::optional<double> tick() const override { return 0.0; }
  bool has(std::string_view) const override { return true; }
};

struct ApronRun {
  ApronRun(apron::program::Program program, const apron::vm::VmOptions& options)
      : vm(std::move(program), options, host) {}
  NullHost host;
  apron::vm::Vm vm;

  Plane plane(const std::string& name) const {
    const auto& registers = vm.program().registers;
    for (std::size_t r = 0; r < registers.size(); ++r)
      if (registers[r].name == name) return vm.plane(r);
    throw std::runtime_error("no register " + name);
  }
};

double checksum(const Plane& plane) {
  Image image(static_cast<int>(plane.width));
  for (std::uint32_t y = 0; y < plane.height; ++y)
    std::copy_n(plane.row(y), plane.width, image.row(static_cast<int>(y)));
  return image.checksum();
}

}  // namespace

std::optional<Job> make_apron_job(int workload, int n, unsigned threads, apron::vm::InstructionSet isa) {
  if (!apron::vm::is_supported(isa)) return std::nullopt;
  apron::syntax::DiskReader reader;
  apron::compiler::CompileOptions compile;
  compile.file = std::string(ARRAYS_SOURCE_DIR "/w") + std::to_string(workload) + ".aps";
  compile.width = compile.height = static_cast<std::uint32_t>(n);
  apron::compiler::CompileResult result = apron::compiler::compile(compile, reader);
  if (!result.program)
    throw std::runtime_error(apron::syntax::format_diagnostics(result.diagnostics, result.sources));
  apron::vm::VmOptions options;
  options.threads = threads;
  options.isa = isa;
  options.fusion.preserve_named_registers = false;
  auto machine = std::make_shared<ApronRun>(std::move(*result.program), options);
  for (int i = 0; i < inputs(workload); ++i) {
    const Image image = input(workload, n, i);
    const Plane plane = machine->plane(i == 0 ? "A" : workload == 1 ? "C" : "B");
    for (int r = 0; r < n; ++r) std::copy_n(image.row(r), n, plane.row(static_cast<std::uint32_t>(r)));
  }
  return Job{[machine] { machine->vm.run(); },
             [machine, workload] {
               if (workload != 2) return checksum(machine->plane("B"));
               double sum = 0;
               for (const char* name : {"A", "B", "C", "D"}) sum += checksum(machine->plane(name));
               return sum;
             }};
}

}  // namespace arrays
