#include "common/gl/EglContext.h"

#include <epoxy/egl.h>
#include <epoxy/gl.h>
#include <gtest/gtest.h>

#include <memory>

#include "common/error/UserError.h"

using common::EglContext;

namespace {

// True if OpenGL commands reach the context; after its display is terminated, there is no version string.
bool is_usable(EglContext& context) {
  context.make_current();
  return glGetString(GL_VERSION) != nullptr && glGetError() == GL_NO_ERROR;
}

TEST(EglContext, FailureKeepsDisplayOfOtherContext) {
  EglContext first;
  EXPECT_THROW(EglContext(99, 0), common::UserError);
  EXPECT_TRUE(is_usable(first));
}

TEST(EglContext, DestructionKeepsDisplayOfOtherContext) {
  auto first = std::make_unique<EglContext>();
  EglContext second;
  first.reset();
  EXPECT_TRUE(is_usable(second));
}

}  // namespace
