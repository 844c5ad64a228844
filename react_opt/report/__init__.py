"""What people look at: tables and pictures of instances and plans."""
