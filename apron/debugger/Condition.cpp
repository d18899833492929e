#include "apron/debugger/Condition.h"

#include <algorithm>
#include <cassert>

namespace apron::debugger {

using program::Opcode;
using vm::HostStatus;

// A question may look at the time and at nothing else outside the program.
class Condition::World final : public vm::Host {
 public:
  explicit World(const vm::Host& real) : real_(real) {}

  std::string message() const override { return "a condition asks registers and scalars only"; }
  void print(std::string_view) override {}
  HostStatus open_array(std::string_view, vm::Plane) override { return HostStatus::kRefused; }
  HostStatus save_array(std::string_view, vm::ConstPlane) override { return HostStatus::kRefused; }
  HostStatus open_image(std::string_view, vm::Plane) override { return HostStatus::kRefused; }
  HostStatus save_image(std::string_view, vm::ConstPlane) override { return HostStatus::kRefused; }
  HostStatus sense(std::string_view, vm::Plane) override { return HostStatus::kRefused; }
  HostStatus actuate(std::string_view, vm::ConstPlane) override { return HostStatus::kRefused; }
  HostStatus actuate(std::string_view, float) override { return HostStatus::kRefused; }
  HostStatus step() override { return HostStatus::kOk; }  // the end of one answer
  std::optional<double> time_s() const override { return real_.time_s(); }
  std::optional<double> dt_s() const override { return real_.dt_s(); }
  std::optional<double> tick() const override { return real_.tick(); }
  bool has(std::string_view channel) const override { return real_.has(channel); }

 private:
  const vm::Host& real_;
};

namespace {

template <class Named, class Pair>
void pair_up(const std::vector<Named>& own, const std::vector<Named>& watched, std::vector<Pair>& pairs) {
  for (std::size_t i = 0; i < own.size(); ++i)
    for (std::size_t j = 0; j < watched.size(); ++j)
      if (own[i].name == watched[j].name && own[i].name.front() != '$') {
        pairs.push_back({j, i});
        break;
      }
}

vm::VmOptions one_thread() {
  vm::VmOptions options;
  options.fusion.enabled = false;  // a handful of instructions
  return options;
}

}  // namespace

Condition::Condition(program::Program question, const program::Program& watched, const vm::Host& world)
    : world_(std::make_unique<World>(world)) {
  pair_up(question.registers, watched.registers, registers_);
  pair_up(question.variables, watched.variables, variables_);
  const auto answer = std::find_if(question.variables.begin(), question.variables.end(),
                                   [](const program::Variable& v) { return v.name == kAnswer; });
  assert(answer != question.variables.end());
  answer_ = static_cast<std::size_t>(answer - question.variables.begin());
  vm_ = std::make_unique<vm::Vm>(std::move(question), one_thread(), *world_);
}

Condition::~Condition() = default;
Condition::Condition(Condition&&) noexcept = default;
Condition& Condition::operator=(Condition&&) noexcept = default;

bool Condition::depends_on(const program::Instruction& instruction) const noexcept {
  const auto among = [&](const std::vector<Pair>& pairs) {
    return std::any_of(pairs.begin(), pairs.end(),
                       [&](const Pair& p) { return p.watched == instruction.destination.index; });
  };
  switch (instruction.op) {
    case Opcode::kResSetReg:
    case Opcode::kResSetVar:  // which one is known only when it runs
    case Opcode::kSurfaceStep:
      return true;
    default:
      break;
  }
  if (instruction.destination.kind == program::OperandKind::kRegister) return among(registers_);
  return instruction.destination.kind == program::OperandKind::kVariable && among(variables_);
}

bool Condition::holds(const vm::Vm& watched) {
  for (const Pair& pair : registers_) {
    const vm::Plane from = watched.plane(pair.watched), to = vm_->plane(pair.own);
    for (std::uint32_t y = 0; y < to.height; ++y) std::copy_n(from.row(y), to.width, to.row(y));
  }
  for (const Pair& pair : variables_) vm_->variable(pair.own) = watched.variable(pair.watched);
  return vm_->run() == vm::Status::kTick && vm_->variable(answer_) != 0.0F;
}

}  // namespace apron::debugger
