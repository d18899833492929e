// Any bytes as a program: it compiles or is refused with diagnostics, what compiles passes the verifier and
// runs, the formatter has a fixed point. Nothing may crash, hang or take memory without bound.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "apron/compiler/Compiler.h"
#include "apron/syntax/Format.h"
#include "apron/vm/Vm.h"

namespace {

using namespace apron;

constexpr std::size_t kMaxBytes = std::size_t{1} << 16;
constexpr std::uint64_t kBudget = 2000;                  // instructions
constexpr std::size_t kMaxCells = std::size_t{1} << 16;  // of all registers of a program that is run

void require(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "fuzz: %s\n", what);
  std::abort();
}

// The library, and the program under its name.
class Reader final : public syntax::FileReader {
 public:
  explicit Reader(std::string text) : text_(std::move(text)) {}
  std::optional<std::string> read(const std::string& path) override {
    const std::string library = APRON_SCRIPTS;
    if (path == "main.aps") return text_;
    const bool inside = path.compare(0, library.size(), library) == 0 && path.find("..") == std::string::npos;
    return inside ? disk_.read(path) : std::nullopt;
  }

 private:
  std::string text_;
  syntax::DiskReader disk_;
};

// Everything there is, and nothing of it kept.
class Host final : public vm::Host {
 public:
  void print(std::string_view) override {}
  vm::HostStatus open_array(std::string_view, vm::Plane to) override { return fill(to); }
  vm::HostStatus save_array(std::string_view, vm::ConstPlane) override { return vm::HostStatus::kOk; }
  vm::HostStatus open_image(std::string_view, vm::Plane to) override { return fill(to); }
  vm::HostStatus save_image(std::string_view, vm::ConstPlane) override { return vm::HostStatus::kOk; }
  vm::HostStatus open_clip(std::string_view) override { return vm::HostStatus::kOk; }
  vm::HostStatus read_clip(vm::Plane to) override { return fill(to); }
  vm::HostStatus open_camera(int) override { return vm::HostStatus::kOk; }
  vm::HostStatus read_camera(vm::Plane to) override { return fill(to); }
  vm::HostStatus call_plugin(std::string_view, int, std::span<const vm::PluginArgument>, vm::Plane to,
                             float* value) override {
    if (value != nullptr) *value = 1.0F;
    return to.data != nullptr ? fill(to) : vm::HostStatus::kOk;
  }
  vm::HostStatus sense(std::string_view, vm::Plane to) override { return fill(to); }
  vm::HostStatus actuate(std::string_view, vm::ConstPlane) override { return vm::HostStatus::kOk; }
  vm::HostStatus actuate(std::string_view, float) override { return vm::HostStatus::kOk; }
  vm::HostStatus step() override { return vm::HostStatus::kOk; }
  std::optional<double> time_s() const override { return 1.0; }
  std::optional<double> dt_s() const override { return 0.5; }
  std::optional<double> tick() const override { return 2.0; }
  bool has(std::string_view) const override { return true; }

 private:
  static vm::HostStatus fill(vm::Plane to) {
    for (std::uint32_t y = 0; y < to.height; ++y)
      for (std::uint32_t x = 0; x < to.width; ++x) to.row(y)[x] = static_cast<float>((x * 7 + y * 3) % 5);
    return vm::HostStatus::kOk;
  }
};

void run(program::Program program) {
  std::size_t cells = 0;
  for (const program::Register& r : program.registers) cells += std::size_t{r.width} * r.height;
  if (cells > kMaxCells) return;
  Host host;
  vm::VmOptions options;
  vm::Vm vm(std::move(program), options, host);
  std::uint64_t left = kBudget;
  while (left > 0) {
    const std::uint64_t before = vm.executed();
    const vm::Status status = vm.run(left);
    left -= std::min(left, std::max<std::uint64_t>(vm.executed() - before, 1));
    if (status != vm::Status::kTick && status != vm::Status::kBudget) break;
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size > kMaxBytes) return 0;
  const std::string text(reinterpret_cast<const char*>(data), size);
  const std::string once = syntax::format_program(text);
  require(syntax::format_program(once) == once, "the formatter has no fixed point");
  compiler::CompileOptions how;
  how.file = "main.aps";
  how.width = 7;
  how.height = 5;
  how.library_path = APRON_SCRIPTS;
  Reader reader(text);
  compiler::CompileResult result = compiler::compile(how, reader);
  require(result.program.has_value() == result.diagnostics.empty(), "a program and diagnostics, or neither");
  if (!result.program) {
    require(!syntax::format(result.diagnostics, result.sources).empty(), "diagnostics without a text");
    return 0;
  }
  require(program::verify(*result.program).empty(), "a compiled program is refused");
  program::disassemble(*result.program);
  run(std::move(*result.program));
  return 0;
}
