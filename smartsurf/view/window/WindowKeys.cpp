#include "smartsurf/view/window/WindowKeys.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

namespace smartsurf::view {
namespace {

struct CharacterKey {
  char character;  // a letter stands for its capital too
  Key key;
};
// By the character typed, so that the keys are where the user's keyboard has them.
constexpr CharacterKey kCharacterKeys[] = {
    {' ', Key::kPause},  {'+', Key::kFaster},    {'=', Key::kFaster},      {'-', Key::kSlower},
    {'_', Key::kSlower}, {'m', Key::kMaxPace},   {'1', Key::kTop},         {'2', Key::kIso},
    {'3', Key::kSide},   {'w', Key::kWireframe}, {'g', Key::kGrid},        {'t', Key::kTrails},
    {'f', Key::kForces}, {'s', Key::kSegments},  {'h', Key::kNextChannel}, {'l', Key::kLabels},
    {'o', Key::kFollow}, {'p', Key::kPicture},   {'v', Key::kFilm},        {'q', Key::kQuit}};

struct CodeKey {
  int code;
  Key key;
  bool repeats;
};
constexpr CodeKey kCodeKeys[] = {
    {GLFW_KEY_RIGHT, Key::kStep, true},       {GLFW_KEY_LEFT, Key::kStepBack, true},
    {GLFW_KEY_BACKSPACE, Key::kReset, false}, {GLFW_KEY_TAB, Key::kPanels, false},
    {GLFW_KEY_F1, Key::kHelp, false},         {GLFW_KEY_ESCAPE, Key::kEscape, false}};

}  // namespace

std::optional<Key> key_of_character(unsigned character) {
  const unsigned small = character >= 'A' && character <= 'Z' ? character - 'A' + 'a' : character;
  for (const CharacterKey& entry : kCharacterKeys)
    if (small == static_cast<unsigned>(entry.character)) return entry.key;
  return std::nullopt;
}

std::optional<Key> key_of_code(int code, bool repeated) {
  for (const CodeKey& entry : kCodeKeys)
    if (entry.code == code && (!repeated || entry.repeats)) return entry.key;
  return std::nullopt;
}

}  // namespace smartsurf::view
