#include "apron/program/MaskFlow.h"

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

using Shape = std::uint64_t;  // width << 32 | height, 0 for "any"

// The masks open at an instruction, as a node of a tree of interned stacks; node 0 is "none open".
struct Open {
  std::uint32_t parent = 0;
  std::uint32_t depth = 0;
  Shape shape = 0;  // of all masks open here
  bool else_seen = false;
};

// What matters to a routine's callers.
struct Routine {
  std::size_t depth = 0;                                     // masks open at once, relative to the caller
  std::set<Shape> shapes;                                    // written where only the caller's masks apply
  std::vector<std::pair<std::uint32_t, std::size_t>> calls;  // open masks, target
};

bool jumps_always(Opcode op) { return op == Opcode::kJump || op == Opcode::kEnd || op == Opcode::kReturn; }

// Index of the label an instruction may go on at, or -1.
std::int64_t target(const Instruction& in) {
  for (const Operand& operand : in.operands) {
    if (operand.kind == OperandKind::kLabel) return operand.index;
  }
  return -1;
}

class MaskFlow {
 public:
  explicit MaskFlow(const Program& program) : program_(program), state_(program.code.size(), kUnseen) {
    nodes_.push_back({});
  }

  std::string run() {
    reach(0, 0);
    while (!work_.empty() && wrong_.empty()) {
      const std::size_t at = work_.back();
      work_.pop_back();
      step(at);
    }
    if (!wrong_.empty()) return wrong_;
    return masked_calls_ ? check_calls() : "";
  }

 private:
  static constexpr std::uint32_t kUnseen = UINT32_MAX;

  Shape shape_of(const Operand& operand) const {
    if (operand.kind != OperandKind::kRegister) return 0;
    const Register& reg = program_.registers[operand.index];
    return (Shape{reg.width} << 32U) | reg.height;
  }

  void fail(std::size_t at, std::string_view text) {
    if (wrong_.empty()) {
      wrong_ = fmt::format("instruction {} ({}): {}", at, info(program_.code[at].op).mnemonic, text);
    }
  }

  void reach(std::size_t at, std::uint32_t open) {
    if (at >= program_.code.size()) return;
    if (state_[at] == kUnseen) {
      state_[at] = open;
      work_.push_back(at);
    } else if (state_[at] != open) {
      fail(at, "masks do not balance on every path to it");
    }
  }

  std::uint32_t intern(Open open) {
    const auto key = std::make_tuple(open.parent, open.shape, open.else_seen);
    const auto [place, added] = interned_.try_emplace(key, static_cast<std::uint32_t>(nodes_.size()));
    if (added) nodes_.push_back(open);
    return place->second;
  }

  std::uint32_t push(std::size_t at, std::uint32_t open) {
    const Shape shape = shape_of(program_.code[at].operands[0]);
    const Open outer = nodes_[open];
    if (outer.depth >= kMaxMaskDepth) fail(at, fmt::format("more than {} masks are open", kMaxMaskDepth));
    if (shape != 0 && outer.shape != 0 && shape != outer.shape)
      fail(at, "its shape differs from the open mask's");
    return intern({open, outer.depth + 1, shape != 0 ? shape : outer.shape, false});
  }

  std::uint32_t turn(std::size_t at, std::uint32_t open) {
    if (open == 0 || nodes_[open].else_seen) fail(at, "no mask is open that it could turn round");
    Open other = nodes_[open];
    other.else_seen = true;
    return wrong_.empty() ? intern(other) : open;
  }

  std::uint32_t pop(std::size_t at, std::uint32_t open) {
    if (open == 0) fail(at, "no mask is open");
    return nodes_[open].parent;
  }

  std::uint32_t after(std::size_t at, std::uint32_t open) {
    switch (program_.code[at].op) {
      case Opcode::kMaskPush:
        return push(at, open);
      case Opcode::kMaskElse:
        return turn(at, open);
      case Opcode::kMaskPop:
        return pop(at, open);
      default:
        return open;
    }
  }

  void step(std::size_t at) {
    const Instruction& in = program_.code[at];
    const std::uint32_t before = state_[at];
    const Shape written = in.masked ? shape_of(in.destination) : 0;
    if (written != 0 && nodes_[before].shape != 0 && written != nodes_[before].shape) {
      fail(at, "its destination differs in shape from the open mask");
    }
    if (in.op == Opcode::kReturn && before != 0) fail(at, "a mask is still open");
    const std::uint32_t open = after(at, before);
    const std::int64_t label = target(in);
    if (in.op == Opcode::kCall) {
      masked_calls_ = masked_calls_ || open != 0;
      reach(static_cast<std::size_t>(label), 0);
    } else if (label >= 0) {
      reach(static_cast<std::size_t>(label), open);
    }
    if (!jumps_always(in.op)) reach(at + 1, open);
  }

  Routine survey(std::size_t entry) const {
    Routine routine;
    std::set<std::size_t> seen{entry};
    std::vector<std::size_t> work{entry};
    const auto go = [&](std::size_t at) {
      if (at < program_.code.size() && seen.insert(at).second) work.push_back(at);
    };
    while (!work.empty()) {
      const std::size_t at = work.back();
      work.pop_back();
      const Instruction& in = program_.code[at];
      const Open& open = nodes_[state_[at]];
      routine.depth = std::max<std::size_t>(routine.depth, open.depth);
      if (in.masked && open.shape == 0 && shape_of(in.destination) != 0) {
        routine.shapes.insert(shape_of(in.destination));
      }
      if (in.op == Opcode::kMaskPush && open.shape == 0 && shape_of(in.operands[0]) != 0) {
        routine.shapes.insert(shape_of(in.operands[0]));
      }
      const std::int64_t label = target(in);
      if (in.op == Opcode::kCall) {
        routine.calls.emplace_back(state_[at], static_cast<std::size_t>(label));
      } else if (label >= 0) {
        go(static_cast<std::size_t>(label));
      }
      if (!jumps_always(in.op)) go(at + 1);
    }
    return routine;
  }

  // Routines called under a mask add to its depth and are bound to its shape, through any chain of calls.
  std::string check_calls() {
    std::map<std::size_t, Routine> routines;
    std::vector<std::size_t> entries{0};
    while (!entries.empty()) {
      const std::size_t entry = entries.back();
      entries.pop_back();
      if (routines.count(entry) > 0) continue;
      const Routine& routine = routines[entry] = survey(entry);
      for (const auto& [open, callee] : routine.calls) entries.push_back(callee);
    }
    for (bool changed = true; changed;) {
      changed = false;
      for (auto& [entry, routine] : routines) {
        for (const auto& [open, callee] : routine.calls) {
          if (!absorb(routine, nodes_[open], routines[callee], changed)) {
            return fmt::format("instruction {}: the routine here is called under a mask of another shape",
                               callee);
          }
        }
        if (routine.depth > kMaxMaskDepth) {
          return fmt::format("instruction {}: calls from here may open more than {} masks", entry,
                             kMaxMaskDepth);
        }
      }
    }
    return {};
  }

  static bool absorb(Routine& caller, const Open& open, const Routine& callee, bool& changed) {
    if (const std::size_t depth = open.depth + callee.depth; depth > caller.depth) {
      caller.depth = depth;
      changed = true;
    }
    for (const Shape shape : std::set<Shape>(callee.shapes)) {
      if (open.shape != 0 && shape != open.shape) return false;
      if (open.shape == 0) changed = caller.shapes.insert(shape).second || changed;
    }
    return true;
  }

  const Program& program_;
  std::vector<std::uint32_t> state_;
  std::vector<Open> nodes_;
  std::map<std::tuple<std::uint32_t, Shape, bool>, std::uint32_t> interned_;
  std::vector<std::size_t> work_;
  std::string wrong_;
  bool masked_calls_ = false;
};

}  // namespace

std::string verify_masks(const Program& program) { return MaskFlow(program).run(); }

}  // namespace apron::program
