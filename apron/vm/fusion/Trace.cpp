#include "apron/vm/fusion/Trace.h"

#include <algorithm>
#include <optional>
#include <unordered_map>

#include "apron/program/LoopCheck.h"
#include "apron/program/ScalarArithmetic.h"

namespace apron::vm {
namespace {

using program::BoundaryRule;
using program::Instruction;
using program::Opcode;
using program::Operand;
using program::OperandKind;

constexpr std::size_t kMaxIndexPlaneCells = std::size_t{1} << 22;
constexpr std::size_t kMaxFilterCoefficients = 64;  // non-zero ones

class TraceBuilder {
 public:
  TraceBuilder(const program::Program& program, const std::vector<DecodedInstruction>& decoded,
               const FlowAnalysis& flow, const FilterPrediction& filters, std::uint32_t entry, bool masked,
               const TraceLimits& limits)
      : program_(program),
        decoded_(decoded),
        limits_(limits),
        flow_(flow),
        filters_(filters),
        boundary_(flow.boundary_at(entry)),
        entered_masked_(masked) {
    trace_.entry = trace_.exit = entry;
    next_ = entry;
  }

  Trace build() {
    while (trace_.instructions.size() < limits_.instructions &&
           trace_.array_instructions < limits_.array_instructions) {
      const std::uint32_t from = next_;
      if (!append(decoded_[from])) break;
      trace_.instructions.push_back(from);
      if (mask_depth_ == 0 && !has_base_mask_ && return_addresses_.empty()) record_exit();
    }
    truncate_to_exit();
    return std::move(trace_);
  }

 private:
  struct ExitPoint {
    std::size_t instructions = 0, array_instructions = 0;
    std::uint32_t exit = 0;
  };

  void record_exit() {
    last_exit_ = {trace_.instructions.size(), trace_.array_instructions, next_};
    if (flow_.is_branch_target(next_)) loop_head_exit_ = last_exit_;
  }

  // Truncates the trace to its last exit, where no mask or call is open. A trace that hit a limit ends at the
  // last loop head instead, unless that is too early: then the next trace begins at a point that recurs.
  void truncate_to_exit() {
    const bool limited = trace_.instructions.size() >= limits_.instructions ||
                         trace_.array_instructions >= limits_.array_instructions;
    const ExitPoint end = limited && loop_head_exit_.array_instructions * 2 >= limits_.array_instructions
                              ? loop_head_exit_
                              : last_exit_;
    trace_.instructions.resize(end.instructions);
    trace_.array_instructions = end.array_instructions;
    if (end.instructions > 0) trace_.exit = end.exit;
  }

  bool append(const DecodedInstruction& decoded) {
    const std::uint32_t next = next_ + 1;
    switch (decoded.dispatch) {
      case DispatchKind::kScalar:
        fold_scalar(decoded);
        break;
      case DispatchKind::kElementwise:
        if (!accept_array_instruction(decoded)) return false;
        break;
      case DispatchKind::kShift:
        if (!can_fuse_shift(decoded) || !accept_array_instruction(decoded)) return false;
        break;
      case DispatchKind::kMask:
        if (!track_mask(decoded)) return false;
        break;
      case DispatchKind::kArrayOp:
        if (!(decoded.op == Opcode::kFilterDo ? can_fuse_filter(decoded) : can_fuse_neighbours(decoded)) ||
            !accept_array_instruction(decoded))
          return false;
        break;
      case DispatchKind::kCellAccess:
        if (!can_fuse_index(decoded) || !accept_array_instruction(decoded)) return false;
        break;
      case DispatchKind::kControlFlow:
        return follow_branch(decoded);
      default:
        return false;
    }
    next_ = next;
    return true;
  }

  bool accept_array_instruction(const DecodedInstruction& decoded) {
    if (!matches_shape(*decoded.destination)) return false;
    if (decoded.masked && entered_masked_) trace_.reads_entry_mask = true;
    ++trace_.array_instructions;
    return true;
  }

  bool matches_shape(const Plane& plane) {
    if (trace_.width == 0) {
      trace_.width = plane.width;
      trace_.height = plane.height;
      trace_.type = plane.type;
    }
    return plane.width == trace_.width && plane.height == trace_.height && plane.type == trace_.type;
  }

  // A boundary's value that integers cannot hold is an error of the instruction.
  bool has_boundary(const DecodedInstruction& decoded) const {
    return boundary_ && (boundary_->rule != BoundaryRule::kValue ||
                         program::is_cell_value(decoded.type, boundary_->value));
  }

  bool can_fuse_shift(const DecodedInstruction& decoded) const {
    if (decoded.op != Opcode::kShift || decoded.has_variable_offset || !has_boundary(decoded)) return false;
    const auto short_way = [](std::int64_t d, std::uint32_t n) {
      return d >= -kMaxFusedShift && d <= kMaxFusedShift && (d < 0 ? -d : d) < static_cast<std::int64_t>(n);
    };
    return short_way(decoded.offset.dx, decoded.destination->width) &&
           short_way(decoded.offset.dy, decoded.destination->height);
  }

  // near.sum to near.all. With 8 neighbours, a constant boundary value v and an operation other than min or
  // max, the row reductions beyond the edge would differ from v, so that the boundary condition cannot be
  // applied to them.
  bool can_fuse_neighbours(const DecodedInstruction& decoded) const {
    if (decoded.op < Opcode::kNearSum || decoded.op > Opcode::kNearAll) return false;
    if (!has_boundary(decoded) || decoded.destination->width < 2 || decoded.destination->height < 2)
      return false;
    const bool rows = *decoded.scalars[1] == 8.0 && boundary_->rule == BoundaryRule::kValue;
    return !rows || decoded.op == Opcode::kNearMin || decoded.op == Opcode::kNearMax;
  }

  // Row indices need a plane of memory in every fused trace that uses them.
  static bool can_fuse_index(const DecodedInstruction& decoded) {
    return decoded.op == Opcode::kCellX ||
           (decoded.op == Opcode::kCellY && decoded.destination->cell_count() <= kMaxIndexPlaneCells);
  }

  // Only small filters are fused.
  bool can_fuse_filter(const DecodedInstruction& decoded) const {
    const program::Filter* f = filters_.find(decoded.table_index);
    if (f == nullptr || !boundary_ || program::is_integer(decoded.type)) return false;
    const auto elements = f->coefficients.size() - std::ranges::count(f->coefficients, 0.0F);
    const auto short_way = [](std::uint32_t extent, std::uint32_t n) {
      return extent / 2 <= kMaxFusedShift && extent / 2 < n;
    };
    return elements <= kMaxFilterCoefficients && short_way(f->width, decoded.destination->width) &&
           short_way(f->height, decoded.destination->height);
  }

  bool track_mask(const DecodedInstruction& decoded) {
    const Plane* plane = decoded.planes[0];
    if (plane != nullptr && !matches_shape(*plane)) return false;
    switch (decoded.op) {
      case Opcode::kMaskPush:
        if (plane == nullptr) return false;
        trace_.mask_depth = std::max(trace_.mask_depth, ++mask_depth_);
        break;
      case Opcode::kMaskElse:
        if (mask_depth_ == 0) return false;
        break;
      case Opcode::kMaskPop:
        if (mask_depth_ == 0) return false;
        --mask_depth_;
        break;
      case Opcode::kMaskOn:
        if (entered_masked_) return false;
        has_base_mask_ = true;
        break;
      default:  // mask.off
        if (!has_base_mask_) return false;
        has_base_mask_ = false;
        break;
    }
    ++trace_.array_instructions;
    return true;
  }

  std::optional<double> known_scalar(const double* scalar) const {
    const auto found = known_scalars_.find(scalar);
    if (found != known_scalars_.end()) return found->second;
    return std::nullopt;
  }

  // A variable's value is known only if the trace assigned a known value to it.
  std::optional<double> operand_value(std::size_t k, const Instruction& in) const {
    const Operand& o = in.operands[k];
    if (o.kind == OperandKind::kLiteral) return program_.literals[o.index];
    return o.kind == OperandKind::kVariable ? known_scalar(decoded_[next_].scalars[k])
                                            : std::optional<double>(0.0);
  }

  void fold_scalar(const DecodedInstruction& decoded) {
    const Instruction& in = program_.code[next_];
    const auto a = operand_value(0, in), b = operand_value(1, in), c = operand_value(2, in);
    known_scalars_[decoded.destination_variable] =
        a && b && c ? std::optional<double>(program::evaluate_scalar(decoded.op, *a, *b, *c)) : std::nullopt;
  }

  bool follow_branch(const DecodedInstruction& decoded) {
    const Instruction& in = program_.code[next_];
    switch (decoded.op) {
      case Opcode::kNop:
        ++next_;
        return true;
      case Opcode::kJump:
        next_ = decoded.jump_target;
        return true;
      case Opcode::kCall:
        if (return_addresses_.size() >= 32) return false;
        return_addresses_.push_back(next_ + 1);
        trace_.call_depth = std::max(trace_.call_depth, return_addresses_.size());
        next_ = decoded.jump_target;
        return true;
      case Opcode::kReturn:
        if (return_addresses_.empty()) return false;
        next_ = return_addresses_.back();
        return_addresses_.pop_back();
        return true;
      case Opcode::kEnd:
      case Opcode::kBoundary:
        return false;
      default:
        break;
    }
    const auto a = operand_value(0, in), b = operand_value(1, in), c = operand_value(2, in);
    if (!a || !b || !c) return false;
    if (decoded.op == Opcode::kCheckFor || decoded.op == Opcode::kCheckRepeat) {
      ++next_;
      return (decoded.op == Opcode::kCheckFor ? program::check_for(*a, *b, *c) : program::check_repeat(*a))
          .empty();
    }
    if (!is_conditional_jump(decoded.op)) return false;
    next_ = is_branch_taken(decoded.op, *a, *b) ? decoded.jump_target : next_ + 1;
    return true;
  }

  const program::Program& program_;
  const std::vector<DecodedInstruction>& decoded_;
  const TraceLimits& limits_;
  const FlowAnalysis& flow_;
  const FilterPrediction& filters_;
  std::optional<BoundaryCondition> boundary_;
  bool entered_masked_;
  bool has_base_mask_ = false;
  std::size_t mask_depth_ = 0;
  std::uint32_t next_ = 0;
  std::vector<std::uint32_t> return_addresses_;
  std::unordered_map<const double*, std::optional<double>> known_scalars_;
  ExitPoint last_exit_, loop_head_exit_;
  Trace trace_;
};

}  // namespace

Trace build_trace(const program::Program& program, const std::vector<DecodedInstruction>& decoded,
                  const FlowAnalysis& flow, const FilterPrediction& filters, std::uint32_t entry, bool masked,
                  const TraceLimits& limits) {
  return TraceBuilder(program, decoded, flow, filters, entry, masked, limits).build();
}

}  // namespace apron::vm
