"""Picture files, one step a module: opened, decoded, encoded. `cvtimg.io` is the face that users see."""
