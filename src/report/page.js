'use strict';
// Makes tables sortable; without script they stay as they are. (No less-than signs and ampersands here: the page is also well-formed XML.)
for (const table of document.querySelectorAll('table[data-sortable]')) {
  const heads = Array.from(table.tHead.rows[0].cells);
  const body = table.tBodies[0];
  const said = document.getElementById(table.dataset.sortable);
  const key = (row, i) => row.cells[i].dataset.sort || row.cells[i].textContent.trim();
  const order = new Intl.Collator('en', { numeric: true, sensitivity: 'base' });
  heads.forEach((head, i) => {
    const name = head.textContent;
    const button = document.createElement('button');
    button.type = 'button';
    button.textContent = name;
    head.replaceChildren(button);
    head.setAttribute('aria-sort', 'none');
    button.addEventListener('click', () => {
      const up = head.getAttribute('aria-sort') !== 'ascending';
      heads.forEach((other) => other.setAttribute('aria-sort', 'none'));
      head.setAttribute('aria-sort', up ? 'ascending' : 'descending');
      const rows = Array.from(body.rows);
      rows.sort((a, b) => (up ? 1 : -1) * order.compare(key(a, i), key(b, i)));
      body.append(...rows);
      said.textContent = 'Sorted by ' + name + (up ? ', ascending' : ', descending');
    });
  });
}
