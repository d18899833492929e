#include "apron/vm/Trace.h"

#include <algorithm>
#include <optional>
#include <unordered_map>

#include "apron/vm/ScalarKernels.h"

namespace apron::vm {
namespace {

using program::BoundaryRule;
using program::Instruction;
using program::Opcode;
using program::Operand;
using program::OperandKind;

constexpr std::size_t kMaxNumberedCells = std::size_t{1} << 22;
constexpr std::size_t kMaxFilterElements = 25;  // that are not 0

class Follower {
 public:
  Follower(const program::Program& program, const std::vector<Step>& steps, const Flow& flow,
           std::uint32_t entry, bool masked, const TraceLimits& limits)
      : program_(program),
        steps_(steps),
        limits_(limits),
        flow_(flow),
        edge_(flow.edge(entry)),
        masked_(masked) {
    trace_.entry = trace_.exit = entry;
    at_ = entry;
  }

  Trace run() {
    while (trace_.path.size() < limits_.path && trace_.array_steps < limits_.array_steps) {
      const std::uint32_t from = at_;
      if (!take(steps_[from])) break;
      trace_.path.push_back(from);
      if (levels_ == 0 && !base_ && calls_.empty()) note_safe();
    }
    truncate();
    return std::move(trace_);
  }

 private:
  struct Safe {
    std::size_t path = 0, array_steps = 0;
    std::uint32_t exit = 0;
  };

  void note_safe() {
    safe_ = {trace_.path.size(), trace_.array_steps, at_};
    if (flow_.is_target(at_)) head_ = safe_;
  }

  // Back to where no mask and no call is open; where the limit came first, to a loop's head, so that the rest
  // of the loop begins where it will begin again.
  void truncate() {
    const bool limited = trace_.path.size() >= limits_.path || trace_.array_steps >= limits_.array_steps;
    const Safe end = limited && head_.array_steps * 2 >= limits_.array_steps ? head_ : safe_;
    trace_.path.resize(end.path);
    trace_.array_steps = end.array_steps;
    if (end.path > 0) trace_.exit = end.exit;
  }

  bool take(const Step& step) {
    const std::uint32_t next = at_ + 1;
    switch (step.action) {
      case Action::kScalar:
        write(step);
        break;
      case Action::kElementwise:
        if (!fits(step)) return false;
        break;
      case Action::kShift:
        if (!near(step) || !fits(step)) return false;
        break;
      case Action::kMask:
        if (!mask(step)) return false;
        break;
      case Action::kArray:
        if (!(step.op == Opcode::kFilterDo ? filter(step) : neighbours(step)) || !fits(step)) return false;
        break;
      case Action::kCell:
        if (!numbers(step) || !fits(step)) return false;
        break;
      case Action::kFlow:
        return jump(step);
      default:
        return false;
    }
    at_ = next;
    return true;
  }

  bool fits(const Step& step) {
    if (!same(*step.y)) return false;
    if (step.masked && masked_) trace_.reads_mask = true;
    ++trace_.array_steps;
    return true;
  }

  bool same(const Plane& plane) {
    if (trace_.width == 0) {
      trace_.width = plane.width;
      trace_.height = plane.height;
    }
    return plane.width == trace_.width && plane.height == trace_.height;
  }

  bool near(const Step& step) const {
    if (step.op != Opcode::kShift || !edge_ || edge_->rule == BoundaryRule::kWrap) return false;
    const auto short_way = [](std::int64_t d, std::uint32_t n) {
      return d >= -kMaxReach && d <= kMaxReach && (d < 0 ? -d : d) < static_cast<std::int64_t>(n);
    };
    return short_way(step.offset.dx, step.y->width) && short_way(step.offset.dy, step.y->height);
  }

  // near.sum … near.all. Of 8 with a value beyond the edge, the rows' sums would not be that value there.
  bool neighbours(const Step& step) const {
    if (step.op < Opcode::kNearSum || step.op > Opcode::kNearAll) return false;
    if (!edge_ || edge_->rule == BoundaryRule::kWrap || step.y->width < 2 || step.y->height < 2) return false;
    const bool rows = *step.scalars[1] == 8.0F && edge_->rule == BoundaryRule::kValue;
    return !rows || step.op == Opcode::kNearMin || step.op == Opcode::kNearMax;
  }

  // The rows' numbers take a plane of memory for each segment that uses them.
  static bool numbers(const Step& step) {
    return step.op == Opcode::kCellX || (step.op == Opcode::kCellY && step.y->cells() <= kMaxNumberedCells);
  }

  // A small one, whose elements are known.
  bool filter(const Step& step) const {
    const program::Filter& f = program_.filters[step.table];
    const auto elements =
        f.elements.size() - static_cast<std::size_t>(std::count(f.elements.begin(), f.elements.end(), 0.0F));
    const bool small = f.width <= kMaxReach && f.height <= kMaxReach && elements <= kMaxFilterElements &&
                       f.width / 2 < step.y->width && f.height / 2 < step.y->height;
    return small && flow_.fixed_filter(step.table) && edge_ && edge_->rule != BoundaryRule::kWrap;
  }

  bool mask(const Step& step) {
    const Plane* plane = step.planes[0];
    if (plane != nullptr && !same(*plane)) return false;
    switch (step.op) {
      case Opcode::kMaskPush:
        if (plane == nullptr) return false;
        trace_.masks = std::max(trace_.masks, ++levels_);
        break;
      case Opcode::kMaskElse:
        if (levels_ == 0) return false;
        break;
      case Opcode::kMaskPop:
        if (levels_ == 0) return false;
        --levels_;
        break;
      case Opcode::kMaskOn:
        if (masked_) return false;
        base_ = true;
        break;
      default:  // mask.off
        if (!base_) return false;
        base_ = false;
        break;
    }
    ++trace_.array_steps;
    return true;
  }

  std::optional<float> known(const float* scalar) const {
    const auto found = known_.find(scalar);
    if (found != known_.end()) return found->second;
    return std::nullopt;
  }

  // Literals lie behind the variables; only what was set on the way is known of a variable.
  std::optional<float> value(std::size_t k, const Instruction& in) const {
    const Operand& o = in.operands[k];
    if (o.kind == OperandKind::kLiteral) return program_.literals[o.index];
    return o.kind == OperandKind::kVariable ? known(steps_[at_].scalars[k]) : std::optional<float>(0.0F);
  }

  void write(const Step& step) {
    const Instruction& in = program_.code[at_];
    const auto a = value(0, in), b = value(1, in), c = value(2, in);
    known_[step.variable] = a && b && c ? std::optional<float>(evaluate(step.op, *a, *b, *c)) : std::nullopt;
  }

  bool jump(const Step& step) {
    const Instruction& in = program_.code[at_];
    switch (step.op) {
      case Opcode::kNop:
        ++at_;
        return true;
      case Opcode::kJump:
        at_ = step.target;
        return true;
      case Opcode::kCall:
        if (calls_.size() >= 32) return false;
        calls_.push_back(at_ + 1);
        trace_.calls = std::max(trace_.calls, calls_.size());
        at_ = step.target;
        return true;
      case Opcode::kReturn:
        if (calls_.empty()) return false;
        at_ = calls_.back();
        calls_.pop_back();
        return true;
      case Opcode::kEnd:
      case Opcode::kBoundary:
        return false;
      default:
        break;
    }
    if (!is_conditional_jump(step.op)) return false;
    const auto a = value(0, in), b = value(1, in);
    if (!a || !b) return false;
    at_ = jumps(step.op, *a, *b) ? step.target : at_ + 1;
    return true;
  }

  const program::Program& program_;
  const std::vector<Step>& steps_;
  const TraceLimits& limits_;
  const Flow& flow_;
  std::optional<Edge> edge_;
  bool masked_;
  bool base_ = false;
  std::size_t levels_ = 0;
  std::uint32_t at_ = 0;
  std::vector<std::uint32_t> calls_;
  std::unordered_map<const float*, std::optional<float>> known_;
  Safe safe_, head_;
  Trace trace_;
};

}  // namespace

Trace follow(const program::Program& program, const std::vector<Step>& steps, const Flow& flow,
             std::uint32_t entry, bool masked, const TraceLimits& limits) {
  return Follower(program, steps, flow, entry, masked, limits).run();
}

}  // namespace apron::vm
