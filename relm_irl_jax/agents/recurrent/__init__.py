"""The paper's network with recurrent memory, the baseline for what memory alone contributes."""
