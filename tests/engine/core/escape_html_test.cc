#include "engine/core/escape_html.h"

#include <gtest/gtest.h>

namespace terrace {
namespace {

TEST(EscapeHtml, LeavesNoMarkup) {
  EXPECT_EQ(EscapeHtml("<a href=\"x\">R&D</a>"), "&lt;a href=&quot;x&quot;&gt;R&amp;D&lt;/a&gt;");
  EXPECT_EQ(EscapeHtml("&amp;"), "&amp;amp;") << "text is not HTML yet";
  EXPECT_EQ(EscapeHtml("Zürich, 46° N"), "Zürich, 46° N");
}

}  // namespace
}  // namespace terrace
