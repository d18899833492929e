#include "apron/compiler/Builtins.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace apron::compiler {
namespace {

using Op = program::Opcode;

constexpr Builtin kTable[] = {
    {"load", Form::kElementwise, 1, 1, Op::kCopy},
    {"copy", Form::kElementwise, 1, 1, Op::kCopy},
    {"add", Form::kElementwise, 2, 2, Op::kAdd},
    {"sub", Form::kElementwise, 2, 2, Op::kSub},
    {"mul", Form::kElementwise, 2, 2, Op::kMul},
    {"div", Form::kElementwise, 2, 2, Op::kDiv},
    {"mod", Form::kElementwise, 2, 2, Op::kMod},
    {"min", Form::kElementwise, 2, 2, Op::kMin},
    {"max", Form::kElementwise, 2, 2, Op::kMax},
    {"pow", Form::kElementwise, 2, 2, Op::kPow},
    {"abs", Form::kElementwise, 1, 1, Op::kAbs},
    {"neg", Form::kElementwise, 1, 1, Op::kNeg},
    {"sign", Form::kElementwise, 1, 1, Op::kSign},
    {"clamp", Form::kElementwise, 3, 3, Op::kClamp},
    {"mac", Form::kMac, 3, 3, Op::kMac},
    {"select", Form::kElementwise, 3, 3, Op::kSelect},
    {"lt", Form::kElementwise, 2, 2, Op::kLt},
    {"le", Form::kElementwise, 2, 2, Op::kLe},
    {"gt", Form::kElementwise, 2, 2, Op::kGt},
    {"ge", Form::kElementwise, 2, 2, Op::kGe},
    {"eq", Form::kElementwise, 2, 2, Op::kEq},
    {"ne", Form::kElementwise, 2, 2, Op::kNe},
    {"and", Form::kElementwise, 2, 2, Op::kAnd},
    {"or", Form::kElementwise, 2, 2, Op::kOr},
    {"xor", Form::kElementwise, 2, 2, Op::kXor},
    {"nand", Form::kElementwise, 2, 2, Op::kNand},
    {"nor", Form::kElementwise, 2, 2, Op::kNor},
    {"not", Form::kElementwise, 1, 1, Op::kNot},
    {"math.sin", Form::kElementwise, 1, 1, Op::kSin},
    {"math.cos", Form::kElementwise, 1, 1, Op::kCos},
    {"math.tan", Form::kElementwise, 1, 1, Op::kTan},
    {"math.sinh", Form::kElementwise, 1, 1, Op::kSinh},
    {"math.cosh", Form::kElementwise, 1, 1, Op::kCosh},
    {"math.tanh", Form::kElementwise, 1, 1, Op::kTanh},
    {"math.asin", Form::kElementwise, 1, 1, Op::kAsin},
    {"math.acos", Form::kElementwise, 1, 1, Op::kAcos},
    {"math.atan", Form::kElementwise, 1, 1, Op::kAtan},
    {"math.atan2", Form::kElementwise, 2, 2, Op::kAtan2},
    {"math.ln", Form::kElementwise, 1, 1, Op::kLn},
    {"math.log", Form::kElementwise, 1, 1, Op::kLog},
    {"math.exp", Form::kElementwise, 1, 1, Op::kExp},
    {"math.sqrt", Form::kElementwise, 1, 1, Op::kSqrt},
    {"math.floor", Form::kElementwise, 1, 1, Op::kFloor},
    {"math.ceil", Form::kElementwise, 1, 1, Op::kCeil},
    {"math.round", Form::kElementwise, 1, 1, Op::kRound},
    {"mask.and", Form::kElementwise, 2, 2, Op::kAnd},
    {"mask.or", Form::kElementwise, 2, 2, Op::kOr},
    {"mask.not", Form::kElementwise, 1, 1, Op::kNot},
    {"mask.if", Form::kMaskIf, 1, 3, Op::kNop},
    {"shift.north", Form::kShift, 1, 2, Op::kShift, 0, -1},
    {"shift.east", Form::kShift, 1, 2, Op::kShift, 1, 0},
    {"shift.south", Form::kShift, 1, 2, Op::kShift, 0, 1},
    {"shift.west", Form::kShift, 1, 2, Op::kShift, -1, 0},
    {"rotate.north", Form::kShift, 1, 2, Op::kRotate, 0, -1},
    {"rotate.east", Form::kShift, 1, 2, Op::kRotate, 1, 0},
    {"rotate.south", Form::kShift, 1, 2, Op::kRotate, 0, 1},
    {"rotate.west", Form::kShift, 1, 2, Op::kRotate, -1, 0},
    {"north", Form::kShift, 1, 1, Op::kShift, 0, 1},
    {"east", Form::kShift, 1, 1, Op::kShift, -1, 0},
    {"south", Form::kShift, 1, 1, Op::kShift, 0, -1},
    {"west", Form::kShift, 1, 1, Op::kShift, 1, 0},
    {"shift", Form::kShiftBy, 3, 3, Op::kShift},
    {"rotate", Form::kShiftBy, 3, 3, Op::kRotate},
    {"near.sum", Form::kNear, 1, 2, Op::kNearSum},
    {"near.min", Form::kNear, 1, 2, Op::kNearMin},
    {"near.max", Form::kNear, 1, 2, Op::kNearMax},
    {"near.any", Form::kNear, 1, 2, Op::kNearAny},
    {"near.all", Form::kNear, 1, 2, Op::kNearAll},
    {"flood", Form::kPropagate, 2, 2, Op::kFlood},
    {"distance", Form::kPropagate, 1, 1, Op::kDistance},
    {"spread.max", Form::kPropagate, 2, 2, Op::kSpreadMax},
    {"filter.create", Form::kFilterCreate, 3, 3},
    {"filter.setElement", Form::kFilterSet, 4, 4, Op::kFilterSet},
    {"filter.fill3x3", Form::kFilterFill, 10, 10},
    {"filter.fill5x5", Form::kFilterFill, 26, 26},
    {"filter.do", Form::kFilterDo, 2, 2, Op::kFilterDo},
    {"filter.gauss.fast", Form::kFilterGauss, 2, 2},
    {"filter.gauss.ani", Form::kFilterGaussAni, 4, 4},
    {"filter.kernel.gabor", Form::kFilterGabor, 4, 6},
    {"filter.stock3x3.edge", Form::kFilterEdge, 1, 1},
    {"random.float.rand", Form::kRandom, 2, 2, Op::kRandomFloat},
    {"random.float.gauss", Form::kRandom, 2, 2, Op::kRandomGauss},
    {"random.float.white", Form::kRandomWhite, 0, 0, Op::kRandomFloat},
    {"random.int.rand", Form::kRandom, 2, 2, Op::kRandomInt},
    {"random.int.gauss", Form::kRandomRounded, 2, 2, Op::kRandomGauss},
    {"random.int.white", Form::kRandomWhite, 0, 0, Op::kRandomInt},
    {"random.seed", Form::kRandomSeed, 1, 1, Op::kRandomSeed},
    {"stack.push_reg", Form::kStackPush, 1, 1, Op::kStackPush},
    {"stack.pop_reg", Form::kStackPop, 0, 0, Op::kStackPop},
    {"stack.clear", Form::kPlain, 0, 0, Op::kStackClear},
    {"res.getvar", Form::kResGet, 2, 2, Op::kResGetVar},
    {"res.setvar", Form::kResSet, 3, 3, Op::kResSetVar},
    {"res.getreg", Form::kResGet, 2, 2, Op::kResGetReg},
    {"res.setreg", Form::kResSet, 3, 3, Op::kResSetReg},
    {"res.match", Form::kResMatch, 2, 2},
    {"plugin", Form::kPlugin, 2, 2 + program::kMaxPluginArguments, Op::kPlugin},
    {"globalsum", Form::kGlobal, 1, 1, Op::kGlobalSum},
    {"globalmean", Form::kGlobal, 1, 1, Op::kGlobalMean},
    {"globalmin", Form::kGlobal, 1, 1, Op::kGlobalMin},
    {"globalmax", Form::kGlobal, 1, 1, Op::kGlobalMax},
    {"globalcount", Form::kGlobal, 1, 1, Op::kGlobalCount},
    {"globalany", Form::kGlobal, 1, 1, Op::kGlobalAny},
    {"pixel.get", Form::kPixelGet, 3, 3, Op::kPixelGet},
    {"pixel.set", Form::kPixelSet, 4, 4, Op::kPixelSet},
    {"cell.x", Form::kCell, 0, 0, Op::kCellX},
    {"cell.col", Form::kCell, 0, 0, Op::kCellX},
    {"cell.y", Form::kCell, 0, 0, Op::kCellY},
    {"cell.row", Form::kCell, 0, 0, Op::kCellY},
    {"reg.getWidth", Form::kRegisterWidth, 1, 1},
    {"reg.getHeight", Form::kRegisterHeight, 1, 1},
    {"reg.getID", Form::kRegisterId, 1, 1},
    {"reg.setPalette", Form::kSetPalette, 2, 3, Op::kSetPalette},
    {"reg.setScale", Form::kSetScale, 2, 3, Op::kSetScale},
    {"mask.on", Form::kMaskOn, 1, 1, Op::kMaskOn},
    {"mask.off", Form::kPlain, 0, 0, Op::kMaskOff},
    {"boundary", Form::kBoundary, 1, 1, Op::kBoundary},
    {"surface.time", Form::kSurfaceScalar, 0, 0, Op::kSurfaceTime},
    {"surface.dt", Form::kSurfaceScalar, 0, 0, Op::kSurfaceDt},
    {"surface.tick", Form::kSurfaceScalar, 0, 0, Op::kSurfaceTick},
    {"surface.has", Form::kHas, 1, 1, Op::kSurfaceHas},
    {"surface.sense", Form::kSense, 1, 1, Op::kSurfaceSense},
    {"surface.actuate", Form::kActuate, 2, 2, Op::kSurfaceActuate},
    {"surface.step", Form::kPlain, 0, 0, Op::kSurfaceStep},
    {"io.array.open", Form::kOpen, 1, 1, Op::kArrayOpen},
    {"io.array.save", Form::kSave, 2, 2, Op::kArraySave},
    {"io.image.open", Form::kOpen, 1, 1, Op::kImageOpen},
    {"io.image.save", Form::kSave, 2, 2, Op::kImageSave},
    {"io.image.opencount", Form::kOpenCount, 2, 2, Op::kImageOpenCount},
    {"io.image.savecount", Form::kSaveCount, 3, 3, Op::kImageSaveCount},
    {"video.clip.open", Form::kClipOpen, 1, 1, Op::kClipOpen},
    {"video.clip.read", Form::kRead, 0, 0, Op::kClipRead},
    {"video.clip.close", Form::kPlain, 0, 0, Op::kClipClose},
    {"webcam.open", Form::kWebcamOpen, 0, 1, Op::kWebcamOpen},
    {"webcam.read", Form::kRead, 0, 0, Op::kWebcamRead},
    {"webcam.close", Form::kPlain, 0, 0, Op::kWebcamClose},
    {"print", Form::kPrint, 0, kAnyNumber},
    {"println", Form::kPrint, 0, kAnyNumber, Op::kPrintLine},
    {"sim.show", Form::kShow, 1, 2, Op::kShow},
    {"sim.display", Form::kShow, 1, 2, Op::kDisplay},
    {"sim.tile", Form::kTile, 0, 2, Op::kTile},
    {"sim.label", Form::kLabelShow, 0, kAnyNumber},
    {"sim.slider.add", Form::kSliderAdd, 3, 4},
    {"sim.slider.get", Form::kParameterGet, 1, 1, Op::kParameter},
    {"sim.switch.add", Form::kSwitchAdd, 1, 2},
    {"sim.switch.get", Form::kParameterGet, 1, 1, Op::kParameter},
    {"timer.start", Form::kTimer, 0, 1, Op::kTimerStart},
    {"timer.stop", Form::kTimer, 0, 1, Op::kTimerStop},
    {"timer.reset", Form::kTimer, 0, 1, Op::kTimerReset},
    {"timer.read", Form::kTimerRead, 0, 1, Op::kTimerRead},
    {"timer.wait", Form::kTimerWait, 1, 1, Op::kTimerWait},
    {"nop", Form::kPlain, 0, 0, Op::kNop},
    {"end", Form::kPlain, 0, 0, Op::kEnd},
    {"return", Form::kReturn, 0, 0, Op::kReturn},
    {"jump", Form::kJump, 1, 1, Op::kJump},
    {"jumpif", Form::kJumpIf, 2, 4},
    {"call", Form::kCall, 1, 1, Op::kCall},
    {"callif", Form::kCallIf, 2, 4},
    {"if", Form::kIf, 1, 3},
    {"else", Form::kElse, 0, 0},
    {"endif", Form::kEndIf, 0, 0},
    {"while", Form::kWhile, 1, 3},
    {"endwhile", Form::kEndWhile, 0, 0},
    {"for", Form::kFor, 3, 4},
    {"endfor", Form::kEndFor, 0, 0},
    {"repeat", Form::kRepeat, 1, 1},
    {"endrepeat", Form::kEndRepeat, 0, 0},
    {"break", Form::kBreak, 0, 0},
    {"continue", Form::kContinue, 0, 0},
    {"where", Form::kWhere, 1, 3},
    {"elsewhere", Form::kElsewhere, 0, 0},
    {"endwhere", Form::kEndWhere, 0, 0},
};

bool starts_with(std::string_view text, std::string_view prefix) {
  return text.substr(0, prefix.size()) == prefix;
}

// core.add is add: the forms of arithmetic, comparison and logic.
bool has_core_form(const Builtin& builtin) {
  const bool plain = builtin.name.find('.') == std::string_view::npos;
  return plain && (builtin.form == Form::kElementwise || builtin.form == Form::kMac);
}

const Builtin* find_exact(std::string_view name) {
  const auto* const found =
      std::find_if(std::begin(kTable), std::end(kTable), [&](const Builtin& b) { return b.name == name; });
  return found == std::end(kTable) ? nullptr : found;
}

}  // namespace

const Builtin* find_builtin(std::string_view name) {
  constexpr std::string_view kCore = "core.";
  if (!starts_with(name, kCore)) return find_exact(name);
  const Builtin* builtin = find_exact(name.substr(kCore.size()));
  return builtin != nullptr && has_core_form(*builtin) ? builtin : nullptr;
}

std::vector<std::string> builtin_names() {
  std::vector<std::string> names;
  for (const Builtin& builtin : kTable) names.emplace_back(builtin.name);
  return names;
}

program::Opcode infix_opcode(std::string_view op) {
  static constexpr std::pair<std::string_view, Op> kInfix[] = {
      {"+", Op::kAdd},   {"-", Op::kSub},     {"*", Op::kMul},  {"/", Op::kDiv}, {"%", Op::kMod},
      {"<", Op::kLt},    {"<=", Op::kLe},     {">", Op::kGt},   {">=", Op::kGe}, {"==", Op::kEq},
      {"!=", Op::kNe},   {"and", Op::kAnd},   {"&&", Op::kAnd}, {"or", Op::kOr}, {"||", Op::kOr},
      {"xor", Op::kXor}, {"nand", Op::kNand}, {"nor", Op::kNor}};
  for (const auto& [text, opcode] : kInfix) {
    if (text == op) return opcode;
  }
  return Op::kNop;
}

}  // namespace apron::compiler
