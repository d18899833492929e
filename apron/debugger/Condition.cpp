#include "apron/debugger/Condition.h"

#include <algorithm>
#include <cassert>

namespace apron::debugger {

using program::Opcode;
using vm::HostStatus;

// Answers queries about time and channels, refuses all other access and ignores output.
class Condition::ReadOnlyHost final : public vm::Host {
 public:
  explicit ReadOnlyHost(const vm::Host& host) : host_(host) {}

  std::string message() const override { return "a condition can only read registers and scalars"; }
  void print(std::string_view) override {}
  HostStatus step() override { return HostStatus::kOk; }  // ends one evaluation
  std::optional<double> time_s() const override { return host_.time_s(); }
  std::optional<double> dt_s() const override { return host_.dt_s(); }
  std::optional<double> tick() const override { return host_.tick(); }
  bool has(std::string_view channel) const override { return host_.has(channel); }

 private:
  const vm::Host& host_;
};

namespace {

template <class Named, class Pair>
void match_by_name(const std::vector<Named>& condition, const std::vector<Named>& debuggee,
                   std::vector<Pair>& pairs) {
  for (std::size_t i = 0; i < condition.size(); ++i)
    for (std::size_t j = 0; j < debuggee.size(); ++j)
      if (condition[i].name == debuggee[j].name && condition[i].name.front() != '$') {
        pairs.push_back({j, i});
        break;
      }
}

vm::VmOptions condition_vm_options() {
  vm::VmOptions options;
  options.fusion.enabled = false;  // does not pay for a handful of instructions
  return options;
}

}  // namespace

Condition::Condition(program::Program condition, const program::Program& debuggee, const vm::Host& host)
    : host_(std::make_unique<ReadOnlyHost>(host)) {
  match_by_name(condition.registers, debuggee.registers, registers_);
  match_by_name(condition.variables, debuggee.variables, variables_);
  const auto result = std::ranges::find_if(
      condition.variables, [](const program::Variable& v) { return v.name == kResultVariable; });
  assert(result != condition.variables.end());
  result_ = result - condition.variables.begin();
  vm_ = std::make_unique<vm::Vm>(std::move(condition), condition_vm_options(), *host_);
}

Condition::~Condition() = default;
Condition::Condition(Condition&&) noexcept = default;
Condition& Condition::operator=(Condition&&) noexcept = default;

bool Condition::depends_on(const program::Instruction& instruction) const noexcept {
  const auto among = [&](const std::vector<IndexPair>& pairs) {
    return std::ranges::any_of(
        pairs, [&](const IndexPair& p) { return p.debuggee == instruction.destination.index; });
  };
  // The destination of res.set* is known only at run time, and that of a matrix product is an array.
  if (instruction.op == Opcode::kResSetReg || instruction.op == Opcode::kResSetVar ||
      instruction.op == Opcode::kMatrixProduct || instruction.op == Opcode::kSurfaceStep)
    return true;
  if (instruction.destination.kind == program::OperandKind::kRegister) return among(registers_);
  return instruction.destination.kind == program::OperandKind::kVariable && among(variables_);
}

std::optional<double> Condition::evaluate(const vm::Vm& debuggee) {
  for (const IndexPair& pair : registers_) {
    const vm::Plane from = debuggee.plane(pair.debuggee), to = vm_->plane(pair.condition);
    for (std::uint32_t y = 0; y < to.height; ++y)
      std::copy_n(from.row_bytes(y), to.width * to.cell_bytes(), to.row_bytes(y));
  }
  for (const IndexPair& pair : variables_) vm_->variable(pair.condition) = debuggee.variable(pair.debuggee);
  if (vm_->run() != vm::Status::kTick) return std::nullopt;
  return static_cast<double>(vm_->variable(result_));
}

}  // namespace apron::debugger
