// Accessibility of the viewer's page as it is now, by axe-core: the rules of WCAG 2.2, A and AA, and axe's best practices.
import assert from 'node:assert/strict';
import axe from 'axe-core';

const kTags = ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa', 'wcag22aa', 'best-practice'];
const kMinContrasts = 5;  // of texts: fewer mean that axe could not see what is behind them

// Checks both themes. The panels are translucent, and axe cannot see a canvas, so the globe gives way to the colour that is
// worst for their contrast: white behind dark panels, black behind light ones.
export async function assertAccessible(page, state) {
  if (!(await page.evaluate(() => 'axe' in window))) await page.evaluate(axe.source);
  for (const [theme, behind] of [['dark', '#ffffff'], ['light', '#000000']]) {
    const { violations, contrasts } = await page.evaluate(async ({ theme, behind, tags }) => {
      const root = document.documentElement, globe = document.getElementById('globe');
      const chosen = root.dataset.theme;
      root.dataset.theme = theme;
      globe.style.background = behind;
      for (const child of globe.children) child.style.visibility = 'hidden';
      const { violations, passes } = await window.axe.run(document, { runOnly: tags, resultTypes: ['violations', 'passes'] });
      root.dataset.theme = chosen;
      globe.style.background = '';
      for (const child of globe.children) child.style.visibility = '';
      const nodesOf = (rule) => rule?.nodes.length ?? 0;
      return {
        contrasts: nodesOf(passes.find(({ id }) => id === 'color-contrast')),
        violations: violations.map(({ id, help, nodes }) => ({
          rule: id, help, nodes: nodes.map(({ html, any, all, none }) => `${html.slice(0, 160)}: ${[...any, ...all, ...none].map(({ message }) => message)}`),
        })),
      };
    }, { theme, behind, tags: kTags });
    assert.deepEqual(violations, [], `${state}, ${theme}: ${JSON.stringify(violations, undefined, 1)}`);
    assert.ok(contrasts >= kMinContrasts, `${state}, ${theme}: only ${contrasts} texts have a known contrast`);
  }
}
