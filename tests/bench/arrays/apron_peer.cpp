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

namespace {

std::shared_ptr<ApronRun> compile(const std::string& file, int n, unsigned threads,
                                  apron::vm::InstructionSet isa,
                                  apron::syntax::FileReader&& reader = apron::syntax::DiskReader()) {
  apron::compiler::CompileOptions compile;
  compile.file = ARRAYS_SOURCE_DIR "/" + file;
  compile.include_paths = {ARRAYS_LIBRARY_DIR};
  compile.width = compile.height = static_cast<std::uint32_t>(n);
  apron::compiler::CompileResult result = apron::compiler::compile(compile, reader);
  if (!result.program)
    throw std::runtime_error(apron::syntax::format_diagnostics(result.diagnostics, result.sources));
  apron::vm::VmOptions options;
  options.threads = threads;
  options.isa = isa;
  options.fusion.observed.all_named = false;
  return std::make_shared<ApronRun>(std::move(*result.program), options);
}

void set_plane(const Plane& plane, const Image& image) {
  for (int r = 0; r < image.n(); ++r)
    std::copy_n(image.row(r), image.n(), plane.row(static_cast<std::uint32_t>(r)));
}

}  // namespace

std::optional<Job> make_apron_job(int workload, int n, unsigned threads, apron::vm::InstructionSet isa) {
  if (!apron::vm::is_supported(isa)) return std::nullopt;
  const auto machine = compile("w" + std::to_string(workload) + ".aps", n, threads, isa);
  for (int i = 0; i < inputs(workload); ++i)
    set_plane(machine->plane(i == 0 ? "A" : workload == 1 ? "C" : "B"), input(workload, n, i));
  return Job{[machine] { machine->vm.run(); },
             [machine, workload] {
               if (workload != 2) return checksum(machine->plane("B"));
               double sum = 0;
               for (const char* name : {"A", "B", "C", "D"}) sum += checksum(machine->plane(name));
               return sum;
             }};
}

std::optional<Job> make_filter_job(const std::string& name, int n, apron::vm::InstructionSet isa) {
  if (!apron::vm::is_supported(isa)) return std::nullopt;
  const auto machine = compile("filters/" + name + ".aps", n, 1, isa);
  set_plane(machine->plane("A"), input(name.starts_with("life") ? 4 : 1, n, 0));
  return Job{[machine] { machine->vm.run(); }, [machine] { return checksum(machine->plane("B")); }};
}

std::optional<Job> make_mathematics_job(const std::string& call, int n, apron::vm::InstructionSet isa) {
  if (!apron::vm::is_supported(isa)) return std::nullopt;
  apron::syntax::MemoryReader reader;
  reader.files[ARRAYS_SOURCE_DIR "/mathematics.aps"] =
      "!register(A, B, C)\nwhile(1)\n  C = " + call +
      "\n  surface.actuate('out', C)\n  surface.step\nendwhile\n";
  const auto machine = compile("mathematics.aps", n, 1, isa, std::move(reader));
  set_plane(machine->plane("A"), input(1, n, 0));
  set_plane(machine->plane("B"), input(1, n, 1));
  return Job{[machine] { machine->vm.run(); }, [machine] { return checksum(machine->plane("C")); }};
}

}  // namespace arrays
