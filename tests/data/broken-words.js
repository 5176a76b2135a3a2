[...document.querySelectorAll('td, th')].flatMap(cell => {
  const found = [], walker = document.createTreeWalker(cell, NodeFilter.SHOW_TEXT);
  for (let node; (node = walker.nextNode()); )
    for (const match of node.data.matchAll(/[a-z]{3,20}/gi)) {
      const range = document.createRange();
      range.setStart(node, match.index);
      range.setEnd(node, match.index + match[0].length);
      const before = node.data[match.index - 1] || '', after = node.data[match.index + match[0].length] || '';
      const boxes = [...range.getClientRects()];  // the head of a table in two columns has two alike
      const isBroken = boxes.some(box => Math.abs(box.width - boxes[0].width) > 1);
      if (isBroken && !/[0-9a-f]/.test(before + after)) found.push(match[0]);
    }
  return found;
})