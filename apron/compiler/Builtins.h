// The language's own statements and instructions by name: how many arguments they take and how they are
// lowered.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "apron/program/Program.h"

namespace apron::compiler {

enum class Form : std::uint8_t {
  // values: y = f(…) and f(y, …)
  kElementwise,
  kMac,
  kShift,    // by (dx, dy) times the distance
  kShiftBy,  // shift(A, dx, dy), rotate(A, dx, dy)
  kNear,
  kMaskIf,
  kGlobal,
  kPixelGet,
  kCell,
  kRegisterWidth,
  kRegisterHeight,
  kRegisterId,
  kSurfaceScalar,
  kSense,
  kHas,
  kOpen,
  kParameterGet,
  kTimerRead,
  kPropagate,
  kFilterDo,
  kFilterGauss,
  kFilterGaussAni,
  kFilterEdge,
  kRandom,
  kRandomWhite,
  kRandomRounded,
  kStackPop,
  kResGet,
  kResMatch,
  kPlugin,
  kOpenCount,
  kRead,
  // statements
  kFilterCreate,
  kFilterSet,
  kFilterFill,
  kFilterGabor,
  kRandomSeed,
  kStackPush,
  kResSet,
  kSaveCount,
  kClipOpen,
  kWebcamOpen,
  kShow,
  kTile,
  kTimer,
  kTimerWait,
  kSetPalette,
  kSetScale,
  kPixelSet,
  kSave,
  kActuate,
  kPlain,  // an instruction without operands
  kMaskOn,
  kBoundary,
  kPrint,
  kSliderAdd,
  kSwitchAdd,
  kLabelShow,
  kJump,
  kJumpIf,
  kCall,
  kCallIf,
  kReturn,
  kIf,
  kElse,
  kEndIf,
  kWhile,
  kEndWhile,
  kFor,
  kEndFor,
  kRepeat,
  kEndRepeat,
  kBreak,
  kContinue,
  kWhere,
  kElsewhere,
  kEndWhere,
};

struct Builtin {
  std::string_view name;
  Form form = Form::kElementwise;
  std::uint8_t least = 0, most = 0;  // arguments, a destination not counted
  program::Opcode op = program::Opcode::kNop;
  std::int8_t dx = 0, dy = 0;  // of one step of a shift: cells east and south

  bool gives_value() const noexcept { return form <= Form::kRead; }
};

inline constexpr std::uint8_t kAnyNumber = 255;

// nullptr for an unknown name.
const Builtin* find_builtin(std::string_view name);
std::vector<std::string> builtin_names();

// The comparison or logical or arithmetic instruction behind an infix operator; kNop if there is none.
program::Opcode infix_opcode(std::string_view op);

}  // namespace apron::compiler
