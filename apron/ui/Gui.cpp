#include "apron/ui/Gui.h"

#include <backends/imgui_impl_opengl3.h>
#include <epoxy/gl.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "common/files/Installation.h"

namespace apron::ui {
namespace {

// Without them ImGui's built-in bitmap font is used.
constexpr const char* kTextFontFile = "DejaVuSans.ttf";
constexpr const char* kCodeFontFile = "DejaVuSansMono.ttf";
constexpr float kTextPixels = 15.0F, kCodePixels = 14.0F, kSmallPixels = 12.0F;

ImFont* load_font(const char* name, float pixels) {
  ImFontAtlas& fonts = *ImGui::GetIO().Fonts;
  if (const std::string file = common::font_file(name).string(); !file.empty())
    return fonts.AddFontFromFileTTF(file.c_str(), std::round(pixels), nullptr, common::kGlyphRanges);
  ImFontConfig config;
  config.SizePixels = std::round(pixels);
  return fonts.AddFontDefault(&config);
}

void set_colours(ImGuiStyle& style) {
  ImGui::StyleColorsLight();
  style.Colors[ImGuiCol_Text] = {0.10F, 0.12F, 0.15F, 1.0F};
  style.Colors[ImGuiCol_WindowBg] = {0.925F, 0.937F, 0.953F, 1.0F};
  style.Colors[ImGuiCol_ChildBg] = {0.985F, 0.988F, 0.992F, 1.0F};
  style.Colors[ImGuiCol_Border] = {0.80F, 0.83F, 0.87F, 1.0F};
  style.Colors[ImGuiCol_Button] = {0.86F, 0.89F, 0.93F, 1.0F};
  style.Colors[ImGuiCol_ButtonHovered] = {0.76F, 0.84F, 0.94F, 1.0F};
  style.Colors[ImGuiCol_ButtonActive] = {0.62F, 0.76F, 0.93F, 1.0F};
  style.Colors[ImGuiCol_SliderGrab] = {0.45F, 0.66F, 0.93F, 0.55F};  // translucent: the number is drawn on it
  style.Colors[ImGuiCol_FrameBg] = {0.91F, 0.93F, 0.95F, 1.0F};
  style.Colors[ImGuiCol_Header] = {0.80F, 0.88F, 0.97F, 1.0F};
  style.Colors[ImGuiCol_Tab] = {0.88F, 0.90F, 0.93F, 1.0F};
  style.Colors[ImGuiCol_TabActive] = {0.985F, 0.988F, 0.992F, 1.0F};
  style.Colors[ImGuiCol_TableRowBgAlt] = {0.0F, 0.0F, 0.0F, 0.025F};
  style.Colors[ImGuiCol_TableHeaderBg] = {0.90F, 0.92F, 0.945F, 1.0F};
}

void set_metrics(ImGuiStyle& style) {
  style.WindowRounding = 0.0F;
  style.WindowBorderSize = 0.0F;
  style.WindowPadding = {8.0F, 8.0F};
  style.ChildRounding = 5.0F;
  style.FrameRounding = 4.0F;
  style.FrameBorderSize = 1.0F;
  style.GrabRounding = 4.0F;
  style.TabRounding = 4.0F;
  style.ScrollbarSize = 12.0F;
  style.FramePadding = {7.0F, 4.0F};
  style.ItemSpacing = {7.0F, 6.0F};
  style.CellPadding = {6.0F, 2.0F};
}

}  // namespace

Gui::Gui(float scale) : scale_(scale) {
  ImGui::CreateContext();
  ImGuiIO& io = ImGui::GetIO();
  io.IniFilename = nullptr;
  text_ = load_font(kTextFontFile, kTextPixels * scale);
  code_ = load_font(kCodeFontFile, kCodePixels * scale);
  small_ = load_font(kTextFontFile, kSmallPixels * scale);
  set_colours(ImGui::GetStyle());
  set_metrics(ImGui::GetStyle());
  ImGui::GetStyle().ScaleAllSizes(scale);
  ImGui_ImplOpenGL3_Init("#version 330 core");
}

Gui::~Gui() {
  ImGui_ImplOpenGL3_Shutdown();
  ImGui::DestroyContext();
}

}  // namespace apron::ui
