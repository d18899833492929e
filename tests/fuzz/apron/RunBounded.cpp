#include "tests/fuzz/apron/RunBounded.h"

#include <algorithm>
#include <cstdint>

#include "apron/vm/Vm.h"

namespace fuzz {

using namespace apron;

namespace {

constexpr std::uint64_t kInstructionBudget = 2000;
constexpr std::size_t kMaxCells = std::size_t{1} << 16;  // of all registers together
// Cells of all registers times elements of the largest filter.
constexpr std::size_t kMaxFilterProducts = std::size_t{1} << 20;

// Provides every file, channel and module, and discards all output.
class StubHost final : public vm::Host {
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
    vm::with_cell_type(to.type, [&to]<class Cell>(Cell) {
      for (std::uint32_t y = 0; y < to.height; ++y)
        for (std::uint32_t x = 0; x < to.width; ++x)
          to.cells<Cell>(y)[x] = static_cast<Cell>((x * 7 + y * 3) % 5);
    });
    return vm::HostStatus::kOk;
  }
};

}  // namespace

void run_bounded(program::Program program) {
  std::size_t cells = 0, elements = 1;
  for (const program::Register& r : program.registers) cells += std::size_t{r.width} * r.height;
  for (const program::Filter& f : program.filters) elements = std::max(elements, f.coefficients.size());
  if (cells > kMaxCells || cells * elements > kMaxFilterProducts) return;
  StubHost host;
  vm::VmOptions options;
  vm::Vm vm(std::move(program), options, host);
  std::uint64_t left = kInstructionBudget;
  while (left > 0) {
    const std::uint64_t before = vm.instructions_executed();
    const vm::Status status = vm.run(left);
    left -= std::min(left, std::max<std::uint64_t>(vm.instructions_executed() - before, 1));
    if (status != vm::Status::kTick && status != vm::Status::kRunning) break;
  }
}

}  // namespace fuzz
