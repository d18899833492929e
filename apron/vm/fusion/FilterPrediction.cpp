#include "apron/vm/fusion/FilterPrediction.h"

#include <algorithm>

#include "apron/program/ScalarArithmetic.h"

namespace apron::vm {

using program::Opcode;

namespace {

constexpr std::size_t kMaxInstructions = 200'000;

class ScalarInterpreter {
 public:
  ScalarInterpreter(const std::vector<DecodedInstruction>& decoded, const RegisterFile& register_file,
                    std::vector<program::Filter>& filters, std::vector<bool>& known)
      : decoded_(decoded),
        base_(register_file.scalars.data()),
        scalars_(register_file.scalars.begin(), register_file.scalars.end()),
        filters_(filters),
        known_(known) {}

  void run() {
    for (std::size_t n = 0; n < kMaxInstructions && program_counter_ < decoded_.size(); ++n)
      if (!execute(decoded_[program_counter_++])) return;
  }

 private:
  using Scalar = std::optional<double>;  // nullopt if unknown

  Scalar value(const DecodedInstruction& decoded, std::size_t k) const {
    return decoded.scalars[k] == nullptr ? Scalar(0.0) : scalars_[decoded.scalars[k] - base_];
  }
  void assign(const double* variable, Scalar to) {
    if (variable != nullptr) scalars_[variable - base_] = to;
  }

  // Returns whether the next instruction is known.
  bool execute(const DecodedInstruction& decoded) {
    if (decoded.dispatch == DispatchKind::kControlFlow) return execute_control_flow(decoded);
    if (decoded.dispatch == DispatchKind::kScalar) {
      const Scalar a = value(decoded, 0), b = value(decoded, 1), c = value(decoded, 2);
      assign(decoded.destination_variable,
             a && b && c ? Scalar(program::evaluate_scalar(decoded.op, *a, *b, *c)) : std::nullopt);
      return true;
    }
    if (decoded.op == Opcode::kFilterSet) set_coefficient(decoded);
    if (decoded.op == Opcode::kResSetVar) return false;  // writes any variable of its group
    if (decoded.op == Opcode::kSurfaceStep && ++steps_ == 2) return false;
    assign(decoded.destination_variable, std::nullopt);
    return true;
  }

  void set_coefficient(const DecodedInstruction& decoded) {
    program::Filter& filter = filters_[decoded.table_index];
    const Scalar index = value(decoded, 1), to = value(decoded, 2);
    const bool valid = index && *index >= 0.0 && *index < static_cast<double>(filter.coefficients.size());
    if (valid && to)
      filter.coefficients[static_cast<std::size_t>(*index)] = static_cast<float>(*to);
    else
      known_[decoded.table_index] = false;
  }

  bool execute_control_flow(const DecodedInstruction& decoded) {
    switch (decoded.op) {
      case Opcode::kNop:
      case Opcode::kBoundary:
        return true;
      case Opcode::kCall:
        return_addresses_.push_back(program_counter_);
        program_counter_ = decoded.jump_target;
        return return_addresses_.size() <= program::kMaxCallDepth;
      case Opcode::kReturn:
        if (return_addresses_.empty()) return false;
        program_counter_ = return_addresses_.back();
        return_addresses_.pop_back();
        return true;
      case Opcode::kJump:
        program_counter_ = decoded.jump_target;
        return true;
      default:
        break;
    }
    const Scalar a = value(decoded, 0), b = value(decoded, 1);
    if (!is_conditional_jump(decoded.op) || !a || !b) return false;
    if (is_branch_taken(decoded.op, *a, *b)) program_counter_ = decoded.jump_target;
    return true;
  }

  const std::vector<DecodedInstruction>& decoded_;
  const double* base_;
  std::vector<Scalar> scalars_;
  std::vector<program::Filter>& filters_;
  std::vector<bool>& known_;
  std::vector<std::size_t> return_addresses_;
  std::size_t program_counter_ = 0;
  int steps_ = 0;
};

}  // namespace

FilterPrediction::FilterPrediction(const program::Program& program,
                                   const std::vector<DecodedInstruction>& decoded,
                                   const RegisterFile& register_file)
    : filters_(program.filters), known_(program.filters.size(), true) {
  const bool modified = std::ranges::any_of(
      decoded, [](const DecodedInstruction& instruction) { return instruction.op == Opcode::kFilterSet; });
  if (modified) ScalarInterpreter(decoded, register_file, filters_, known_).run();
}

}  // namespace apron::vm
