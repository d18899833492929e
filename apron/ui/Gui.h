// Sets up Dear ImGui with this module's fonts and colours in the current OpenGL context. Internal to this
// module.
#pragma once

#include <imgui.h>

namespace apron::ui {

// Owns the process's only ImGui context.
class Gui {
 public:
  // scale: pixels per point.
  explicit Gui(float scale);
  ~Gui();
  Gui(const Gui&) = delete;
  Gui& operator=(const Gui&) = delete;

  float scale() const { return scale_; }
  ImFont* text() const { return text_; }
  ImFont* code() const { return code_; }  // monospaced
  ImFont* small() const { return small_; }

 private:
  float scale_;
  ImFont *text_ = nullptr, *code_ = nullptr, *small_ = nullptr;
};

// Colours in addition to ImGui's style.
namespace theme {
inline constexpr ImU32 kFaint = IM_COL32(96, 105, 118, 255);
inline constexpr ImU32 kLine = IM_COL32(208, 214, 222, 255);
inline constexpr ImU32 kAccent = IM_COL32(20, 98, 190, 255);
inline constexpr ImU32 kCurrent = IM_COL32(255, 226, 130, 255);
inline constexpr ImU32 kStop = IM_COL32(200, 44, 40, 255);
inline constexpr ImU32 kGo = IM_COL32(30, 130, 60, 255);
inline constexpr ImU32 kComment = IM_COL32(84, 122, 84, 255);
inline constexpr ImU32 kDirective = IM_COL32(130, 64, 150, 255);
inline constexpr ImU32 kBackdrop = IM_COL32(226, 230, 236, 255);
}  // namespace theme

}  // namespace apron::ui
