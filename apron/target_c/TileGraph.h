// A program as regions of straight-line code for a tile. Control flow depends on scalars alone, and no local
// instruction makes a scalar from cells: all tiles take the same path. A region is what the controller
// executes between two branches whose conditions are only known at run time; branches and loops with known
// conditions are unrolled into it.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "apron/program/Program.h"
#include "apron/target_c/TargetC.h"

namespace apron::target_c {

using NodeId = std::uint32_t;
inline constexpr NodeId kNoNode = ~NodeId{0};

enum class NodeKind : std::uint8_t {
  // Scalars: equal on all tiles.
  kLiteral,
  kScalarEntry,   // the value that a slot has where the region begins
  kClock,         // index: 0 tick, 1 seconds, 2 seconds between ticks
  kScalarOp,      // op of operands
  kScalarRandom,  // op of operands a, b and the seed
  // Planes.
  kHome,     // the value that a home has where the region begins
  kPlaneOp,  // op of operands, planes or scalars
  kRead,     // the cell at (dx, dy) of operand 0; beyond the table by the rule, with operand 1 as its value
  kSense,    // the frame of a sensor channel
  kCellX,
  kCellY,
  kRandom,   // op of operands a, b and the seed, one draw for each cell
  kActuate,  // writes operand 0 to an actuator channel
};

struct Node {
  NodeKind kind = NodeKind::kLiteral;
  program::Opcode op = program::Opcode::kNop;
  std::array<NodeId, 3> operands{kNoNode, kNoNode, kNoNode};
  // The type of a plane's cells; an element-wise instruction takes scalars as numbers of it.
  program::CellType type = program::CellType::kFloat32;
  double literal = 0.0;
  std::uint32_t index = 0;  // slot, home, channel or clock
  std::int8_t dx = 0, dy = 0;
  program::BoundaryRule rule = program::BoundaryRule::kZero;
  // Number of a draw: from the seed on, or after those that the region finds.
  bool draws_follow = false;
  std::uint64_t draw = 0;

  bool is_scalar() const { return kind <= NodeKind::kScalarRandom; }
};

// The homes of planes between regions: registers, then the masks of nested blocks, the base mask, and the
// register stack.
struct Homes {
  std::vector<program::CellType> registers;
  std::uint32_t register_count() const { return static_cast<std::uint32_t>(registers.size()); }
  std::uint32_t level(std::size_t depth) const {
    return register_count() + static_cast<std::uint32_t>(depth);
  }
  std::uint32_t base() const { return register_count() + static_cast<std::uint32_t>(program::kMaxMaskDepth); }
  // Each type of cells has places of its own on the stack.
  std::uint32_t stacked(std::size_t depth, program::CellType type) const {
    return base() + 1 +
           static_cast<std::uint32_t>(type) * static_cast<std::uint32_t>(program::kMaxStackDepth) +
           static_cast<std::uint32_t>(depth);
  }
  // Masks are 0 or 1, and have no type of their own.
  program::CellType type(std::uint32_t home) const {
    if (home < register_count()) return registers[home];
    if (home <= base()) return program::CellType::kFloat32;
    return static_cast<program::CellType>((home - base() - 1) /
                                          static_cast<std::uint32_t>(program::kMaxStackDepth));
  }
};

enum class Ending : std::uint8_t { kJump, kBranch, kStep, kEnd, kFail };

struct Region {
  std::size_t first_instruction = 0;
  bool is_start = false;
  std::vector<Node> nodes;                                 // operands precede their users
  std::map<std::uint32_t, NodeId> homes_out, scalars_out;  // those that the region changes
  std::vector<NodeId> actuations;
  bool draws_follow = true;  // the number of draws grows by `draws`, or is `draws`
  std::uint64_t draws = 0;
  Ending ending = Ending::kEnd;
  // kBranch: next[0] where the comparison op of operands a and b is as `expected`, next[1] otherwise.
  program::Opcode comparison = program::Opcode::kNop;
  bool expected = true;
  NodeId a = kNoNode, b = kNoNode;
  std::string error;  // kFail: with file and line
  std::array<std::uint32_t, 2> next{0, 0};

  std::size_t successor_count() const {
    return ending >= Ending::kEnd ? 0 : ending == Ending::kBranch ? 2 : 1;
  }
};

struct Channel {
  std::string name;
  bool is_sensor = false;
};

struct TileProgram {
  Homes homes;
  std::vector<float> scalar_start;  // initial values of the slots: variables, then what the tracer adds
  std::vector<Channel> channels;
  std::vector<Region> regions;  // the first is where the program begins
  bool uses_random = false;
  std::array<bool, 3> uses_clock{};
  std::vector<std::string> warnings;
};

// Throws common::UserError: one line for each instruction that boards cannot execute.
TileProgram trace(const program::Program& program, const Options& options);

}  // namespace apron::target_c
