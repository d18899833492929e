#include "apron/ui/window/OffscreenRenderer.h"

#include <backends/imgui_impl_opengl3.h>
#include <epoxy/gl.h>

#include "apron/ui/Gui.h"
#include "apron/ui/panels/Panels.h"
#include "apron/ui/panels/TextureCache.h"
#include "common/error/UserError.h"
#include "common/gl/EglContext.h"
#include "common/gl/Framebuffer.h"

namespace apron::ui {
namespace {

constexpr int kMaxEdge = 8192;
// Passes until sizes, scroll positions and visible thumbnails have settled.
constexpr int kSettlePasses = 4;

}  // namespace

struct OffscreenRenderer::State {
  State(int w, int h, float scale) : width(w), height(h), gui(scale) {
    glGenFramebuffers(1, &framebuffer);
    glGenRenderbuffers(1, &colour);
    glBindRenderbuffer(GL_RENDERBUFFER, colour);
    glRenderbufferStorage(GL_RENDERBUFFER, GL_RGBA8, width, height);
    glBindFramebuffer(GL_FRAMEBUFFER, framebuffer);
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, colour);
    if (glCheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE)
      throw common::UserError("this machine cannot draw a picture of " + std::to_string(width) + "x" +
                              std::to_string(height) + " pixels");
    ImGuiIO& io = ImGui::GetIO();
    io.DisplaySize = {static_cast<float>(width), static_cast<float>(height)};
    io.DeltaTime = 1.0F / 60.0F;  // constant, so that the same input produces the same picture
    for (int key = 0; key < ImGuiKey_COUNT; ++key) io.KeyMap[key] = key;
  }
  ~State() {
    glDeleteRenderbuffers(1, &colour);
    glDeleteFramebuffers(1, &framebuffer);
  }

  int width, height;
  common::EglContext context;
  Gui gui;
  TextureCache textures;
  GLuint framebuffer = 0, colour = 0;
};

OffscreenRenderer::OffscreenRenderer(int width, int height, float scale) {
  if (width < 1 || height < 1 || width > kMaxEdge || height > kMaxEdge)
    throw common::UserError("a picture has 1 to " + std::to_string(kMaxEdge) + " pixels per edge");
  state_ = std::make_unique<State>(width, height, scale);
}

OffscreenRenderer::~OffscreenRenderer() = default;

void OffscreenRenderer::set_mouse(float x, float y, bool down, float wheel) {
  ImGuiIO& io = ImGui::GetIO();
  io.MousePos = {x, y};
  io.MouseDown[0] = down;
  io.MouseWheel = wheel;
}

void OffscreenRenderer::type_character(unsigned character) { ImGui::GetIO().AddInputCharacter(character); }

common::Image OffscreenRenderer::render(ViewModel& model) {
  State& state = *state_;
  ImGui_ImplOpenGL3_NewFrame();
  ImGui::NewFrame();
  DrawContext context{model, state.textures, state.gui};
  draw_window(context);
  ImGui::Render();
  glBindFramebuffer(GL_FRAMEBUFFER, state.framebuffer);
  glViewport(0, 0, state.width, state.height);
  glClearColor(1.0F, 1.0F, 1.0F, 1.0F);
  glClear(GL_COLOR_BUFFER_BIT);
  ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
  return common::read_framebuffer(state.width, state.height);
}

common::Image OffscreenRenderer::render_settled(ViewModel& model) {
  for (int i = 1; i < kSettlePasses; ++i) render(model);
  return render(model);
}

unsigned OffscreenRenderer::take_gl_error() { return glGetError(); }
std::uint64_t OffscreenRenderer::texture_uploads() const { return state_->textures.uploads(); }

}  // namespace apron::ui
