#include "apron/program/MaskVerifier.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <map>
#include <set>
#include <tuple>
#include <utility>
#include <vector>

namespace apron::program {
namespace {

using Shape = std::uint64_t;  // width << 32 | height; 0 means any shape

// A stack of open masks: a node of a tree of interned stacks, linked to the node without its top. Node 0 is
// the empty stack.
struct MaskState {
  std::uint32_t parent = 0;
  std::uint32_t depth = 0;
  Shape mask_shape = 0;  // shape of the register masks on the stack
  bool inverted = false;
};

// A routine's effects that its callers must check.
struct RoutineSummary {
  std::size_t max_depth = 0;                                 // masks open at once, beyond the caller's
  std::set<Shape> written_shapes;                            // written under none of the routine's own masks
  std::vector<std::pair<std::uint32_t, std::size_t>> calls;  // mask state, entry of the callee
};

bool never_falls_through(Opcode op) {
  return op == Opcode::kJump || op == Opcode::kEnd || op == Opcode::kReturn;
}

// Index of the instruction's jump or call target, or -1.
std::int64_t label_target(const Instruction& in) {
  for (const Operand& operand : in.operands) {
    if (operand.kind == OperandKind::kLabel) return operand.index;
  }
  return -1;
}

// Data-flow analysis of the mask stack. Every instruction must have one entry state on all paths. Routines
// are analysed with an empty stack; verify_calls() then adds the masks of their callers.
class MaskVerifier {
 public:
  explicit MaskVerifier(const Program& program)
      : program_(program), entry_state_(program.code.size(), kUnvisited) {
    states_.push_back({});
  }

  std::string run() {
    merge_state(0, 0);
    while (!worklist_.empty() && error_.empty()) {
      const std::size_t at = worklist_.back();
      worklist_.pop_back();
      visit(at);
    }
    if (!error_.empty()) return error_;
    return has_masked_calls_ ? verify_calls() : "";
  }

 private:
  static constexpr std::uint32_t kUnvisited = UINT32_MAX;

  Shape shape_of(const Operand& operand) const {
    if (operand.kind != OperandKind::kRegister) return 0;
    const Register& reg = program_.registers[operand.index];
    return (Shape{reg.width} << 32U) | reg.height;
  }

  void fail(std::size_t at, std::string_view text) {
    if (error_.empty()) {
      error_ = fmt::format("instruction {} ({}): {}", at, opcode_info(program_.code[at].op).mnemonic, text);
    }
  }

  void merge_state(std::size_t at, std::uint32_t mask_state) {
    if (at >= program_.code.size()) return;
    if (entry_state_[at] == kUnvisited) {
      entry_state_[at] = mask_state;
      worklist_.push_back(at);
    } else if (entry_state_[at] != mask_state) {
      fail(at, "masks do not balance on every path to it");
    }
  }

  std::uint32_t intern(MaskState mask_state) {
    const auto key = std::make_tuple(mask_state.parent, mask_state.mask_shape, mask_state.inverted);
    const auto [place, added] = interned_states_.try_emplace(key, static_cast<std::uint32_t>(states_.size()));
    if (added) states_.push_back(mask_state);
    return place->second;
  }

  std::uint32_t push_mask(std::size_t at, std::uint32_t mask_state) {
    const Shape shape = shape_of(program_.code[at].operands[0]);
    const MaskState outer = states_[mask_state];
    if (outer.depth >= kMaxMaskDepth) fail(at, fmt::format("more than {} masks are open", kMaxMaskDepth));
    if (shape != 0 && outer.mask_shape != 0 && shape != outer.mask_shape)
      fail(at, "its shape differs from the open mask's");
    return intern({mask_state, outer.depth + 1, shape != 0 ? shape : outer.mask_shape, false});
  }

  std::uint32_t invert_mask(std::size_t at, std::uint32_t mask_state) {
    if (mask_state == 0 || states_[mask_state].inverted) fail(at, "no mask is open that it could turn round");
    MaskState inverted = states_[mask_state];
    inverted.inverted = true;
    return error_.empty() ? intern(inverted) : mask_state;
  }

  std::uint32_t pop_mask(std::size_t at, std::uint32_t mask_state) {
    if (mask_state == 0) fail(at, "no mask is open");
    return states_[mask_state].parent;
  }

  std::uint32_t transfer(std::size_t at, std::uint32_t mask_state) {
    switch (program_.code[at].op) {
      case Opcode::kMaskPush:
        return push_mask(at, mask_state);
      case Opcode::kMaskElse:
        return invert_mask(at, mask_state);
      case Opcode::kMaskPop:
        return pop_mask(at, mask_state);
      default:
        return mask_state;
    }
  }

  void visit(std::size_t at) {
    const Instruction& in = program_.code[at];
    const std::uint32_t before = entry_state_[at];
    const Shape written = in.masked ? shape_of(in.destination) : 0;
    if (written != 0 && states_[before].mask_shape != 0 && written != states_[before].mask_shape) {
      fail(at, "its destination differs in shape from the open mask");
    }
    if (in.op == Opcode::kReturn && before != 0) fail(at, "a mask is still open");
    const std::uint32_t mask_state = transfer(at, before);
    const std::int64_t label = label_target(in);
    if (in.op == Opcode::kCall) {
      has_masked_calls_ = has_masked_calls_ || mask_state != 0;
      merge_state(label, 0);
    } else if (label >= 0) {
      merge_state(label, mask_state);
    }
    if (!never_falls_through(in.op)) merge_state(at + 1, mask_state);
  }

  RoutineSummary summarize_routine(std::size_t entry) const {
    RoutineSummary routine;
    std::set<std::size_t> visited{entry};
    std::vector<std::size_t> worklist{entry};
    const auto enqueue = [&](std::size_t at) {
      if (at < program_.code.size() && visited.insert(at).second) worklist.push_back(at);
    };
    while (!worklist.empty()) {
      const std::size_t at = worklist.back();
      worklist.pop_back();
      const Instruction& in = program_.code[at];
      const MaskState& mask_state = states_[entry_state_[at]];
      routine.max_depth = std::max<std::size_t>(routine.max_depth, mask_state.depth);
      if (in.masked && mask_state.mask_shape == 0 && shape_of(in.destination) != 0) {
        routine.written_shapes.insert(shape_of(in.destination));
      }
      if (in.op == Opcode::kMaskPush && mask_state.mask_shape == 0 && shape_of(in.operands[0]) != 0) {
        routine.written_shapes.insert(shape_of(in.operands[0]));
      }
      const std::int64_t label = label_target(in);
      if (in.op == Opcode::kCall) {
        routine.calls.emplace_back(entry_state_[at], label);
      } else if (label >= 0) {
        enqueue(label);
      }
      if (!never_falls_through(in.op)) enqueue(at + 1);
    }
    return routine;
  }

  // Interprocedural check: a routine called under a mask adds to its depth and must write registers of its
  // shape, through any chain of calls. Iterates the summaries to a fixed point.
  std::string verify_calls() {
    std::map<std::size_t, RoutineSummary> routines;
    std::vector<std::size_t> entries{0};
    while (!entries.empty()) {
      const std::size_t entry = entries.back();
      entries.pop_back();
      if (routines.count(entry) > 0) continue;
      const RoutineSummary& routine = routines[entry] = summarize_routine(entry);
      for (const auto& [open, callee] : routine.calls) entries.push_back(callee);
    }
    for (bool changed = true; changed;) {
      changed = false;
      for (auto& [entry, routine] : routines) {
        for (const auto& [open, callee] : routine.calls) {
          if (!merge_callee(routine, states_[open], routines[callee], changed)) {
            return fmt::format("instruction {}: the routine here is called under a mask of another shape",
                               callee);
          }
        }
        if (routine.max_depth > kMaxMaskDepth) {
          return fmt::format("instruction {}: calls from here may open more than {} masks", entry,
                             kMaxMaskDepth);
        }
      }
    }
    return {};
  }

  static bool merge_callee(RoutineSummary& caller, const MaskState& mask_state, const RoutineSummary& callee,
                           bool& changed) {
    if (const std::size_t depth = mask_state.depth + callee.max_depth; depth > caller.max_depth) {
      caller.max_depth = depth;
      changed = true;
    }
    for (const Shape shape : std::set<Shape>(callee.written_shapes)) {
      if (mask_state.mask_shape != 0 && shape != mask_state.mask_shape) return false;
      if (mask_state.mask_shape == 0) changed = caller.written_shapes.insert(shape).second || changed;
    }
    return true;
  }

  const Program& program_;
  std::vector<std::uint32_t> entry_state_;
  std::vector<MaskState> states_;
  std::map<std::tuple<std::uint32_t, Shape, bool>, std::uint32_t> interned_states_;
  std::vector<std::size_t> worklist_;
  std::string error_;
  bool has_masked_calls_ = false;
};

}  // namespace

std::string verify_masks(const Program& program) { return MaskVerifier(program).run(); }

}  // namespace apron::program
