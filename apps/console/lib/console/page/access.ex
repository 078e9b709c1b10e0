defmodule Console.Page.Access do
  @moduledoc """
  Decides which requests may look at the page and command by it. Pure.

  A browser that shows a page of strangers may be made to call this one. It says then where it comes from (`Origin`), and
  by which name it was sent here (`Host`): a foreign name for an address of this machine is not taken.
  On the loopback that is all; elsewhere a token is demanded in the address. A browser that has said it once has a
  cookie that is no token, but a long number of this run of the page: it cannot be guessed, so a browser that is in never
  waits behind those that guess (`Console.Page.Guesses`).

  Behind a proxy browsers know the page by the proxy's address, its `origin`. The proxy may pass on their `Host` or say its own.
  """

  @type request :: %{
          host: String.t() | nil,
          origin: String.t() | nil,
          token: String.t() | nil,
          session: String.t() | nil
        }

  @typedoc "The page's token, the cookie of browsers that have said it, and the origin of its proxy; `nil` for none."
  @type guard :: %{token: String.t() | nil, session: String.t(), origin: String.t() | nil}

  @doc "Whether only this machine reaches the address."
  @spec loopback?(:inet.ip_address()) :: boolean()
  def loopback?({127, _, _, _}), do: true
  def loopback?({0, 0, 0, 0, 0, 0, 0, 1}), do: true
  def loopback?(_address), do: false

  @doc """
  `:ok`, `:guess` if it depends on the token that it says (`same?/2`), or the status and the line of a refusal.

      iex> home = %{token: nil, session: "long", origin: nil}
      iex> at_home = %{host: "localhost:4000", origin: "http://localhost:4000", token: nil, session: nil}
      iex> Console.Page.Access.check(at_home, home)
      :ok
      iex> Console.Page.Access.check(%{at_home | origin: "http://elsewhere.example"}, home)
      {403, "pages of http://elsewhere.example may not use this one; if that is this page behind a proxy: --page-origin http://elsewhere.example"}
      iex> Console.Page.Access.check(%{at_home | host: "rebound.example:4000", origin: nil}, home)
      {403, "this page is not rebound.example: use an address, or localhost; if that is its proxy: --page-origin https://rebound.example"}
      iex> guarded = %{home | token: "secret"}
      iex> Console.Page.Access.check(at_home, guarded)
      {401, "a token is needed: open the page with ?token=…"}
      iex> Console.Page.Access.check(%{at_home | token: "secret"}, guarded)
      :guess
      iex> Console.Page.Access.check(%{at_home | token: "wrong", session: "long"}, guarded)
      :ok
      iex> proxied = %{at_home | host: "robots.lab.example", origin: "https://robots.lab.example"}
      iex> for request <- [proxied, %{proxied | host: "127.0.0.1:4000"}, %{proxied | origin: nil}],
      ...>     do: Console.Page.Access.check(request, %{home | origin: "https://robots.lab.example"})
      [:ok, :ok, :ok]
  """
  @spec check(request(), guard()) :: :ok | :guess | {400..499, String.t()}
  def check(%{host: host, origin: from} = request, %{origin: origin} = guard) do
    cond do
      host == nil ->
        {400, "a request without Host"}

      not here?(name(host)) and not proxy?(host, origin) ->
        {403,
         "this page is not #{name(host)}: use an address, or localhost; if that is its proxy: --page-origin https://#{name(host)}"}

      from not in [nil, "http://" <> host, origin] ->
        {403,
         "pages of #{from} may not use this one; if that is this page behind a proxy: --page-origin #{from}"}

      guard.token == nil or same?(request.session, guard.session) ->
        :ok

      request.token == nil ->
        {401, "a token is needed: open the page with ?token=…"}

      true ->
        :guess
    end
  end

  @doc "Whether a text is the secret one; takes as long for each that is not."
  @spec same?(String.t() | nil, String.t()) :: boolean()
  def same?(nil, _secret), do: false
  def same?(given, secret), do: :crypto.hash(:sha256, given) == :crypto.hash(:sha256, secret)

  @doc "Whether the request came by the name of the proxy, whose `origin` this is."
  @spec proxy?(host :: String.t(), String.t() | nil) :: boolean()
  def proxy?(_host, nil), do: false
  def proxy?(host, origin), do: String.downcase(name(host)) == URI.parse(origin).host

  # A name server can give any name any address, but no address another.
  defp here?("localhost"), do: true
  defp here?(name), do: match?({:ok, _ip}, :inet.parse_strict_address(String.to_charlist(name)))

  defp name("[" <> rest), do: rest |> String.split("]") |> hd()
  defp name(host), do: host |> String.split(":") |> hd()
end
